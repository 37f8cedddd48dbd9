//! Pictures and films of recordings: what is asked for is drawn, and the same of runs on either device.

use std::borrow::Cow;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};

use super::fixture::{problem, record};

pub fn gridfall(arguments: &[&str], paths: &[(&str, &Path)]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    command.args(arguments);
    paths.iter().for_each(|(option, path)| {
        (!option.is_empty()).then(|| command.arg(option));
        command.arg(path);
    });
    command.output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs a scene on a device and returns where its recording is.
pub fn simulated(scene: &Value, folder: &Path, device: &str) -> std::path::PathBuf {
    let (file, out) = (folder.join("scene.json"), folder.join(format!("{device}.mcap")));
    std::fs::write(&file, scene.to_string()).unwrap();
    // The only GPU that tests need is a driver's in software.
    let on = if device == "gpu" { &["--backend", "gpu", "--adapter", "llvmpipe"][..] } else { &["--backend", device] };
    let output = gridfall(&[&["run"], on].concat(), &[("", &file), ("-o", &out)]);
    assert!(output.status.success(), "{}", said(&output));
    out
}

fn render(recording: &Path, to: &Path, arguments: &[&str]) -> Output {
    gridfall(&[&["render"], arguments].concat(), &[("", recording), ("-o", to)])
}

fn rendered(recording: &Path, to: &Path, arguments: &[&str]) {
    let output = render(recording, to, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", said(&output));
}

struct Picture {
    size: [usize; 2],
    rgb: Vec<u8>,
}

impl Picture {
    fn read(path: &Path) -> Self {
        let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rgb).unwrap();
        let info = reader.info();
        Self { size: [info.width as usize, info.height as usize], rgb }
    }

    fn at(&self, [x, y]: [usize; 2]) -> [u8; 3] {
        self.rgb[3 * (y * self.size[0] + x)..][..3].try_into().unwrap()
    }

    /// Share of the pixels that are of about this colour.
    fn share(&self, like: impl Fn([u8; 3]) -> bool) -> f64 {
        let n = self.rgb.len() / 3;
        (0..n).filter(|k| like(self.rgb[3 * k..][..3].try_into().unwrap())).count() as f64 / n as f64
    }

    /// Mean difference of the values, and the share of those that differ by more than 24 of 255.
    fn differences(&self, other: &Self) -> (f64, f64) {
        assert_eq!(self.size, other.size);
        let differences: Vec<f64> = self.rgb.iter().zip(&other.rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).collect();
        let n = differences.len() as f64;
        let large = differences.iter().filter(|difference| **difference > 24.0).count();
        (differences.iter().sum::<f64>() / n, large as f64 / n)
    }
}

/// Jelly that falls into water.
fn splash() -> Value {
    json!({
        "gridfall": 1, "name": "splash",
        "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.0625 },
        "gravity": [0, 0, -9.81],
        "materials": {
            "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 2e4, "poissons_ratio": 0.4 },
            "water": { "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 2e4 }
        },
        "bodies": [
            { "name": "ball", "material": "jelly", "velocity": [0, 0, -1],
              "shape": { "sphere": { "center": [0.5, 0.5, 0.5], "radius": 0.2 } } },
            { "name": "pool", "material": "water", "shape": { "box": { "min": [0, 0, 0], "max": [1, 1, 0.25] } } }
        ],
        "time": { "end": 0.15, "frame_rate": 20 },
        "output": { "fields": ["velocity", "pressure", "plastic_strain"] }
    })
}

/// Sand that slides over a post, in the plane.
fn slope() -> Value {
    json!({
        "gridfall": 1, "name": "slope", "dimension": 2,
        "domain": { "min": [0, 0], "max": [1, 0.5], "dx": 0.02 },
        "gravity": [0, -9.81],
        "materials": { "sand": { "model": "drucker-prager", "density": 1600, "youngs_modulus": 1e5,
                                 "poissons_ratio": 0.3, "friction_angle_degrees": 30 } },
        "bodies": [ { "name": "heap", "material": "sand", "sampling": "poisson-disk",
                      "shape": { "box": { "min": [0.1, 0.0], "max": [0.4, 0.3] } } } ],
        "colliders": [ { "name": "post", "contact": "slip",
                         "shape": { "sphere": { "center": [0.55, 0.0], "radius": 0.1 } } } ],
        "time": { "end": 0.2, "frame_rate": 20 }
    })
}

#[test]
fn both_devices_give_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = ["cpu", "gpu"].map(|device| simulated(&splash(), folder.path(), device));
    for arguments in [&["--size", "640x360"][..], &["--size", "640x360", "--color-by", "speed", "--range", "0,2"]] {
        let [cpu, gpu] = recordings.each_ref().map(|recording| {
            let to = folder.path().join("a.png");
            rendered(recording, &to, arguments);
            Picture::read(&to)
        });
        let (mean, large) = cpu.differences(&gpu);
        // Drops lie where rounding leaves them.
        assert!(mean < 0.5 && large < 0.005, "{arguments:?}: {mean} on average, {large} differ much");
        assert!(cpu.share(|[r, _, b]| r.abs_diff(b) > 60) > 0.02, "there is something to see");
    }
}

#[test]
fn sand_has_grains() {
    let folder = tempfile::tempdir().unwrap();
    let recording = simulated(&slope(), folder.path(), "cpu");
    let to = folder.path().join("a.png");
    let sandy = |[r, _, b]: [u8; 3]| r > b.saturating_add(40);
    rendered(&recording, &to, &[]);
    let whole = Picture::read(&to);
    // The heap has 0.09 of the 0.5 m² of the domain, which has most of the picture.
    assert!((0.1..0.25).contains(&whole.share(sandy)), "{}", whole.share(sandy));
    rendered(&recording, &to, &["--camera", "look_at=0.25,0.05,zoom=8"]);
    let near = Picture::read(&to);
    let light = |k: usize| f64::from(near.rgb[3 * k]) + f64::from(near.rgb[3 * k + 1]);
    let all: Vec<f64> = (0..near.rgb.len() / 3).map(light).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let deviation = (all.iter().map(|light| (light - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
    assert!(near.share(sandy) > 0.95, "no paper shows between grains");
    assert!(deviation > 20.0, "grains are told from each other: {deviation}");
}

#[test]
fn pictures_are_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    // As many particles as the scene that goes into the recording makes.
    let recording = record(&problem(0.025), folder.path()).recording;
    let to = folder.path().join("a.png");
    let picture = |arguments: &[&str]| {
        rendered(&recording, &to, arguments);
        Picture::read(&to)
    };
    let blue = |[r, _, b]: [u8; 3]| b > r.saturating_add(50);
    let red = |[r, _, b]: [u8; 3]| r > b.saturating_add(50);
    let plain = picture(&[]);
    assert!(plain.size == [960, 540] && plain.share(blue) > 0.01 && plain.share(red) > 0.003);
    assert!(picture(&["--frame", "5"]).rgb == plain.rgb, "the last frame is the default");
    assert!(picture(&["--frame", "0"]).rgb != plain.rgb);
    let cube = picture(&["--body", "cube", "--size", "320x200"]);
    assert!(cube.size == [320, 200] && cube.share(blue) < 0.001 && cube.share(red) > 0.003);
    let near = picture(&["--body", "cube", "--size", "320x200", "--camera", "zoom=2"]);
    assert!(near.share(red) > 2.5 * cube.share(red));
    let above = picture(&["--camera", "azimuth=-90,elevation=90,look_at=1.3,0.5,0.25,distance=4", "--frame", "0"]);
    let [r, _, b] = above.at([480, 270]);
    assert!(b > r + 15, "the pool is in the middle, {:?}", above.at([480, 270]));
    // The lowest of the values is dark, the highest is yellow.
    let colored = picture(&["--colour-by", "vz", "--range", "-3,0", "--frame", "0"]);
    assert!(colored.share(|[r, g, b]| r > 150 && g > 150 && b < 120) > 0.01, "what does not fall is yellow");
    // What is not a number is grey, and the legend of bodies has their colours.
    let bodies = picture(&["--color-by", "body"]);
    assert!(blue(bodies.at([94 + 2, 515])) || bodies.share(blue) > 0.01);

    for (arguments, said_so) in [
        (&["--color-by", "plastic_strain"][..], "no field \"plastic_strain\"; they have speed, vx, vy, vz, J"),
        (&["--body", "pond"], "no body or source \"pond\"; there are cube, pool"),
        (&["--frame", "6"], "no frame 6; the recording has the frames 0 to 5"),
        (&["--frame", "first"], "neither the number of a frame nor last"),
        (&["--camera", "roll=3"], "a camera has no \"roll\""),
        (&["--size", "10x10"], "64 to"),
        (&["--range", "0,1"], "--color-by"),
        (&["--range", "1,0", "--color-by", "J"], "below the second"),
    ] {
        let output = render(&recording, &to, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(said_so), "{}", said(&output));
    }
    // An eighth of them.
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    let output = render(&record(&problem(0.05), &other).recording, &to, &[]);
    assert!(output.status.code() == Some(2) && said(&output).contains("do not belong together"), "{}", said(&output));
    let output = render(&recording, &folder.path().join("a.bmp"), &[]);
    assert!(
        output.status.code() == Some(2) && said(&output).contains(".png, .gif, .apng or .mp4"),
        "{}",
        said(&output)
    );
}

#[test]
fn films_have_all_frames() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&problem(0.025), folder.path()).recording;
    let size = &["--size", "320x180", "--fps", "10"][..];
    let gif = folder.path().join("a.gif");
    rendered(&recording, &gif, &[size, &["--color-by", "speed"]].concat());
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(std::fs::File::open(&gif).unwrap()).unwrap();
    assert_eq!((decoder.width(), decoder.height()), (320, 180));
    let mut frames = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!(frame.delay, 10);
        frames.push(frame.buffer.to_vec());
    }
    assert_eq!(frames.len(), 6);
    assert!(frames.windows(2).all(|pair| pair[0] != pair[1]));

    let apng = folder.path().join("a.apng");
    rendered(&recording, &apng, &[size, &["--frames", "1..=5", "--every", "2", "--color-by", "speed"]].concat());
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&apng).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
    let mut frame = || {
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    let frames = [frame(), frame(), frame()];
    assert!(frames.windows(2).all(|pair| pair[0] != pair[1]));
    // Field, colours and numbers of the legend are the same in all frames; the time at its end is not.
    let legend = |frame: &[u8]| (140..180).map(|row| frame[3 * 320 * row..][..3 * 200].to_vec()).collect::<Vec<_>>();
    assert!(frames.iter().all(|frame| legend(frame) == legend(&frames[0])));

    let mp4 = folder.path().join("a.mp4");
    rendered(&recording, &mp4, size);
    let probe = ["-v", "error", "-count_frames", "-of", "csv=p=0"];
    let entries = ["-show_entries", "stream=codec_name,width,height,r_frame_rate,nb_read_frames"];
    let output = Command::new("ffprobe").args(probe).args(entries).arg(&mp4).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), "h264,320,180,10/1,6");
    let output = render(&recording, &mp4, &["--size", "321x180"]);
    assert!(output.status.code() == Some(2) && said(&output).contains("even"), "{}", said(&output));
    // Without ffmpeg there is a remedy, and nothing is left behind.
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    command.args(["render", "-o"]).arg(folder.path().join("b.mp4")).arg(&recording).env("PATH", folder.path());
    let output = command.output().unwrap();
    assert!(
        output.status.code() == Some(2) && said(&output).contains("install it, or write a .gif"),
        "{}",
        said(&output)
    );
    let left = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let left: Vec<String> = left.filter(|name| name.starts_with("b.") || name.ends_with(".partial")).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn recordings_of_other_programs_have_no_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    let mut writer = mcap::Writer::new(std::io::BufWriter::new(std::fs::File::create(&path).unwrap())).unwrap();
    writer.add_channel(0, "/particles", "protobuf", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: 0, sequence: 0, log_time: 0, publish_time: 0 };
    let channel = mcap::Channel {
        id: 1,
        topic: "/particles".into(),
        schema: None,
        message_encoding: "protobuf".into(),
        metadata: Default::default(),
    };
    let message = mcap::Message {
        channel: channel.into(),
        sequence: header.sequence,
        log_time: 0,
        publish_time: 0,
        data: Cow::Borrowed(&[]),
    };
    writer.write(&message).unwrap();
    writer.finish().unwrap();
    let output = render(&path, &folder.path().join("a.png"), &[]);
    let errors = said(&output);
    assert!(
        output.status.code() == Some(2) && errors.contains("it has no scene: it was not written by Gridfall"),
        "{errors}"
    );
}
