//! Mean distances of clusters that are far from each other, by their moments.
