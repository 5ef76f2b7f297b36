fn main() { println!("rigsmith"); }
