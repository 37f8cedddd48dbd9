use gridfall::{recording, scene};
use std::time::Instant;
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
#[test]
fn look() {
    let json = std::fs::read_to_string(std::env::var("SCENE").unwrap()).unwrap();
    let s = scene::parse(&json).unwrap();
    let mut p = scene::problem(&s, &Default::default()).unwrap();
    println!("{} particles", p.particles.len());
    if let Ok(limit) = std::env::var("SLOSH") {
        // fake dam: shear the column
        let k: f64 = limit.parse().unwrap();
        for x in p.particles.x.iter_mut() {
            let h = x[2];
            x[0] = x[0] * (1.0 + k * (1.0 - h));
            x[2] = h / (1.0 + k * 0.7);
        }
        for (v, x) in p.particles.v.iter_mut().zip(&p.particles.x) {
            v[0] = 2.0 * x[0];
        }
    }
    let (t, c) = (Instant::now(), cpu());
    let png = recording::thumbnail(&p, &p.particles, 0.2);
    println!("thumbnail {:?}, cpu {}", t.elapsed(), cpu() - c);
    std::fs::write("/tmp/look.png", png).unwrap();
}
