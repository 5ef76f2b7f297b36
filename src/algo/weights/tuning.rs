#[derive(Debug, Clone)]
pub struct Tuning {
    pub heat: f32,
    pub radius_power: f32,
    pub share_band: f32,
    pub sight_margin: f32,
    pub leaf_reach: f32,
    pub tries: usize,
    pub air: f32,
    pub tube: f32,
    pub rounds: usize,
    pub leak: f32,
    pub region: f32,
    pub beyond: f32,
    pub quantile: f32,
}
impl Default for Tuning {
    fn default() -> Self { Self { heat: 8.0, radius_power: 0.0, share_band: 0.1, sight_margin: 1e-3, leaf_reach: 0.8, tries: 8, air: 0.25, tube: 1.0, rounds: 0, leak: 0.25, region: 0.9, beyond: 1.0, quantile: 0.4 } }
}
impl Tuning {
    pub fn env() -> Self {
        let mut t = Self::default();
        let get = |n: &str, d: f32| std::env::var(n).ok().and_then(|v| v.parse().ok()).unwrap_or(d);
        t.heat = get("HEAT", t.heat);
        t.radius_power = get("RADP", t.radius_power);
        t.share_band = get("BAND", t.share_band);
        t.sight_margin = get("MARGIN", t.sight_margin);
        t.leaf_reach = get("REACH", t.leaf_reach);
        t.tries = get("TRIES", t.tries as f32) as usize;
        t.air = get("AIR", t.air);
        t.region = get("REGION", t.region);
        t.rounds = get("ROUNDS", t.rounds as f32) as usize;
        t.leak = get("LEAK", t.leak);
        t.tube = get("TUBE", t.tube);
        t.beyond = get("BEYOND", t.beyond);
        t.quantile = get("QUANT", t.quantile);
        t
    }
}
