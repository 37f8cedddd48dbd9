//! Storage that cannot be used.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::process::{Command, Output};

use super::s3::S3;
use super::serve;

/// A server that ends at once, and what it says.
fn refused(url: &str, environment: &[(&str, String)]) -> (Option<i32>, String) {
    let dir = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--files", url, "--data-dir"]);
    let Output { status, stderr, .. } =
        command.arg(dir.path()).envs(environment.iter().map(|(name, value)| (name, value))).output().unwrap();
    (status.code(), String::from_utf8(stderr).unwrap())
}

#[test]
fn addresses_and_credentials_that_are_none() {
    let s3 = S3::start();
    let good = s3.environment().to_vec();
    let with = |name: &str, value: &str| {
        let mut environment = good.clone();
        environment.iter_mut().filter(|(other, _)| *other == name).for_each(|(_, old)| *old = value.into());
        environment
    };
    let cases = [
        ("gs://bucket", good.clone(), "is no address of S3"),
        ("s3://", good.clone(), "names no bucket"),
        ("s3://key:secret@bucket", good.clone(), "credentials and the endpoint come from the environment"),
        ("s3://bucket?x=1", good.clone(), "has more than a bucket"),
        ("s3://recordings/x", with("AWS_SECRET_ACCESS_KEY", "other"), "AWS_SECRET_ACCESS_KEY"),
        ("s3://recordings/x", with("AWS_ENDPOINT_URL", "http://127.0.0.1:9"), "cannot be used: "),
    ];
    for (url, environment, wanted) in cases {
        let (code, said) = refused(url, &environment);
        println!("{said}");
        assert_eq!(code, Some(2), "{url}: {said}");
        assert!(said.contains("--files: ") && said.contains(wanted), "{url}: {said}");
        assert!(!said.contains("secret"), "{said}");
    }
}

#[test]
fn a_prefix_is_of_one_database() {
    let (s3, dir) = (S3::start(), tempfile::tempdir().unwrap());
    assert!(serve(&s3, "one", &dir.path().join("data"), &[]).terminate().success());
    assert!(serve(&s3, "one", &dir.path().join("data"), &[]).terminate().success());
    let (code, said) = refused(&s3.url("one"), &s3.environment());
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("has the files of another job database"), "{said}");
}

/// It answers to all that it has been done.
#[test]
fn storage_that_lets_two_write_the_same_is_refused() {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            std::thread::spawn(move || {
                let mut stream = stream.unwrap();
                let mut reader = BufReader::new(stream.try_clone().unwrap());
                loop {
                    let mut length = 0;
                    let mut line = String::new();
                    while reader.read_line(&mut line).is_ok_and(|bytes| bytes > 2) {
                        let field = line.to_lowercase();
                        let value = field.strip_prefix("content-length:").map(|value| value.trim().parse());
                        length = value.and_then(Result::ok).unwrap_or(length);
                        line.clear();
                    }
                    if line.is_empty() {
                        return;
                    }
                    reader.read_exact(&mut vec![0; length]).unwrap();
                    let xml = "<DeleteResult xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\"></DeleteResult>";
                    let _ =
                        write!(stream, "HTTP/1.1 200 OK\r\netag: \"1\"\r\ncontent-length: {}\r\n\r\n{xml}", xml.len());
                }
            });
        }
    });
    let mut environment = S3::start().environment().to_vec();
    environment[0].1 = format!("http://127.0.0.1:{port}");
    let (code, said) = refused("s3://recordings/x", &environment);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("ignores If-None-Match"), "{said}");
}
