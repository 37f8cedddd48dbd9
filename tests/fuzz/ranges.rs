//! `Range` and `If-Range` at a real server: each answer is the whole file, a part that it names, or a refusal.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::campaign;

/// A file that the server accepts.
const FILE: &[u8] = include_bytes!("corpus/mesh/box.obj");

struct Server {
    child: Child,
    address: String,
    connection: Option<BufReader<TcpStream>>,
}

struct Answer {
    status: u16,
    /// Names in lower case.
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Answer {
    fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }
}

impl Server {
    fn start(dir: &Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_gridfall"))
            .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"])
            .arg(dir)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on http://").expect("it says where it listens").to_owned();
        Self { child, address, connection: None }
    }

    fn exchange(&mut self, request: &[u8]) -> io::Result<Answer> {
        let connection = match &mut self.connection {
            Some(connection) => connection,
            none => none.insert(BufReader::new(TcpStream::connect(&self.address)?)),
        };
        connection.get_mut().write_all(request)?;
        let line = |connection: &mut BufReader<TcpStream>| -> io::Result<String> {
            let mut line = String::new();
            match connection.read_line(&mut line)? {
                0 => Err(io::ErrorKind::UnexpectedEof.into()),
                _ => Ok(line.trim_end().to_owned()),
            }
        };
        let status = line(connection)?.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status");
        let mut headers = Vec::new();
        loop {
            let line = line(connection)?;
            let Some((name, value)) = line.split_once(':') else { break };
            headers.push((name.to_ascii_lowercase(), value.trim().to_owned()));
        }
        let mut answer = Answer { status, headers, body: Vec::new() };
        let length = answer.header("content-length").and_then(|length| length.parse().ok()).expect("a length");
        answer.body.resize(length, 0);
        connection.read_exact(&mut answer.body)?;
        // The server ends a connection on which it could not read a request.
        if status == 400 || answer.header("connection") == Some("close") {
            self.connection = None;
        }
        Ok(answer)
    }

    /// The answer, over a new connection if the last one has ended.
    fn call(&mut self, request: &[u8]) -> Answer {
        self.exchange(request).unwrap_or_else(|_| {
            self.connection = None;
            self.exchange(request).unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(request)))
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Fails unless the answer is one of the three that there are.
fn judge(answer: &Answer) {
    let range = answer.header("content-range").map(|range| range.strip_prefix("bytes ").expect("of bytes"));
    match answer.status {
        200 => assert!(answer.body == FILE && range.is_none()),
        206 => {
            let (part, length) = range.and_then(|range| range.split_once('/')).expect("which part");
            let (first, last) = part.split_once('-').expect("its ends");
            let [first, last, length] = [first, last, length].map(|n| n.parse::<usize>().expect("a number"));
            assert!(length == FILE.len() && answer.body == FILE[first..=last], "{first}-{last}/{length}");
        }
        416 => assert_eq!(range, Some(format!("*/{}", FILE.len()).as_str())),
        // No header at all: bytes that none may have, or too many.
        400 | 431 => {}
        status => panic!("{status}: {}", String::from_utf8_lossy(&answer.body)),
    }
}

#[test]
fn range() {
    let dir = tempfile::tempdir().unwrap();
    let mut server = Server::start(dir.path());
    let head = format!("PUT /v1/assets HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", FILE.len());
    let put = server.call(&[head.as_bytes(), FILE].concat());
    let path = put.header("location").expect("the file is kept").to_owned();
    let whole = server.call(format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes());
    let tag = whole.header("etag").expect("it has a version").to_owned();
    let date = whole.header("last-modified").unwrap_or("Sat, 29 Oct 1994 19:43:31 GMT");
    let headers = [
        "bytes=0-0".to_owned(),
        "bytes=2-5\n".to_owned() + &tag,
        "bytes=2-\nW/".to_owned() + &tag,
        "bytes=-3\n".to_owned() + date,
        "bytes=0-18446744073709551615".into(),
        "bytes=100000-".into(),
        "bytes=0-1,4-5".into(),
        "bytes= 1 - 2 ".into(),
        "lines=+1--2".into(),
    ];
    campaign::run("range", headers.map(String::into_bytes).into(), |input| {
        // The first line is the range, the second the condition; more of them would be other headers.
        let clean = |line: &[u8]| line.iter().copied().filter(|c| !b"\r\n".contains(c)).collect::<Vec<u8>>();
        let mut lines = input.splitn(2, |c| *c == b'\n').map(clean);
        let mut request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nRange: ").into_bytes();
        request.extend(lines.next().unwrap_or_default());
        if let Some(condition) = lines.next() {
            request.extend(b"\r\nIf-Range: ");
            request.extend(condition);
        }
        request.extend(b"\r\n\r\n");
        let answer = server.call(&request);
        judge(&answer);
        answer.status.to_string()
    });
}
