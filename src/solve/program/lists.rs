//! Lists of small numbers in one allocation.

/// Lists of small numbers in one allocation.
#[derive(Debug, Default)]
pub(super) struct Lists {
    starts: Vec<u32>,
    pub items: Vec<u32>,
}

impl Lists {
    /// Lists of the second numbers of all pairs with the same first number, below `count`: sorted, each number once.
    pub fn new(count: usize, pairs: &[(u32, u32)]) -> Self {
        let mut ends = vec![0_u32; count + 1];
        let is_listed = |(list, _): &&(u32, u32)| (*list as usize) < count;
        pairs.iter().filter(is_listed).for_each(|(list, _)| ends[*list as usize + 1] += 1);
        (0..count).for_each(|list| ends[list + 1] += ends[list]);
        let mut sorted = vec![0; ends[count] as usize];
        let mut next = ends.clone();
        for (list, item) in pairs.iter().filter(is_listed) {
            let place = &mut next[*list as usize];
            sorted[*place as usize] = *item;
            *place += 1;
        }
        let mut made = Self { starts: Vec::with_capacity(count + 1), items: Vec::with_capacity(sorted.len()) };
        made.starts.push(0);
        for list in 0..count {
            let items = &mut sorted[ends[list] as usize..ends[list + 1] as usize];
            items.sort_unstable();
            let start = made.items.len();
            for item in items {
                if made.items[start..].last() != Some(item) {
                    made.items.push(*item);
                }
            }
            made.starts.push(made.items.len() as u32);
        }
        made
    }

    pub fn get(&self, at: usize) -> &[u32] {
        &self.items[self.starts[at] as usize..self.starts[at + 1] as usize]
    }
}
