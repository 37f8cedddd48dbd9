use gridfall::{cpu::CpuEngine, engine::*, scene, sim::diagnostics::Row};
use std::io::Write;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let text = std::fs::read_to_string(&a[1]).unwrap();
    let sc = scene::parse_with(&text, &a[3..]).unwrap_or_else(|f| {
        for f in f {
            println!("{f}")
        }
        std::process::exit(2)
    });
    let p = scene::problem(&sc, &scene::Limits::default()).unwrap_or_else(|f| {
        for f in f {
            println!("{f}")
        }
        std::process::exit(2)
    });
    println!("{:#?}", scene::estimate::estimate(&p));
    if a[2] == "-" {
        return;
    }
    let mut e = CpuEngine::new(&p).unwrap();
    let mut out = std::fs::File::create(&a[2]).unwrap();
    let t = std::time::Instant::now();
    let mut steps = 0;
    for n in 0..=p.frames {
        let st = if n > 0 {
            match e.advance_frame(p.frame_s, &NoControl) {
                Ok(s) => s,
                Err(e) => {
                    println!("frame {n}: {e}");
                    break;
                }
            }
        } else {
            FrameStats::default()
        };
        steps += st.steps;
        let s = e.snapshot().unwrap();
        let row = Row::measure(&p, &s, n as u64, n as f64 * p.frame_s, &st);
        if n % (p.frames / 12).max(1) == 0 {
            println!("{}", serde_json::to_string(&row).unwrap());
            for i in 0..s.len() {
                let w = (s.v[i][0].powi(2) + s.v[i][1].powi(2) + s.v[i][2].powi(2)).sqrt();
                for q in [s.x[i][0], s.x[i][1], s.x[i][2], s.body[i] as f64, w] {
                    out.write_all(&(q as f32).to_le_bytes()).unwrap();
                }
            }
        }
    }
    let w = t.elapsed().as_secs_f64();
    println!(
        "{} particles, {steps} steps, {w:.1} s, {:.2} M/s",
        p.particles.len(),
        p.particles.len() as f64 * steps as f64 / w / 1e6
    );
}
