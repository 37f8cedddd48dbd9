//! Which addresses webhooks may be at: none by which a stranger could use this server to reach what he cannot reach
//! himself.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

pub use ipnet::IpNet as Range;

/// Reads a range of addresses (CIDR), or one address.
pub fn range(text: &str) -> Result<Range, String> {
    let one = |address: IpAddr| Range::from(address);
    let read = text.parse().or_else(|_| text.parse().map(one));
    read.map_err(|_| format!("{text:?} is no range of addresses, such as 10.1.0.0/16, ::1/128 or 192.168.1.7"))
}

/// Why no webhook may be at an address; `None` where one may.
pub fn fault(address: IpAddr, allowed: &[Range]) -> Option<&'static str> {
    let address = plain(address);
    if allowed.iter().any(|range| range.contains(&address)) {
        return None;
    }
    match address {
        IpAddr::V4(address) => fault_v4(address),
        IpAddr::V6(address) => fault_v6(address),
    }
}

/// An IPv4 address that is written as one of IPv6 is one of IPv4: the system connects to it.
fn plain(address: IpAddr) -> IpAddr {
    address.to_canonical()
}

fn fault_v4(address: Ipv4Addr) -> Option<&'static str> {
    let octets = address.octets();
    let within = |net: [u8; 4], bits: u32| {
        let mask = u32::MAX << (32 - bits);
        u32::from(address) & mask == u32::from(Ipv4Addr::from(net)) & mask
    };
    match () {
        () if address.is_loopback() => Some("an address of the server's own machine"),
        () if address.is_private() => Some("a private address"),
        // Among them 169.254.169.254, where clouds answer with keys.
        () if address.is_link_local() => Some("a link-local address"),
        () if within([100, 64, 0, 0], 10) => Some("an address of a provider's inside"),
        () if octets[0] == 0 || octets[0] >= 224 => Some("no address of a machine"),
        () if within([192, 0, 0, 0], 24)
            || within([192, 0, 2, 0], 24)
            || within([192, 88, 99, 0], 24)
            || within([198, 18, 0, 0], 15)
            || within([198, 51, 100, 0], 24)
            || within([203, 0, 113, 0], 24) =>
        {
            Some("an address for special purposes")
        }
        () => None,
    }
}

fn fault_v6(address: Ipv6Addr) -> Option<&'static str> {
    let parts = address.segments();
    match () {
        () if address.is_loopback() => Some("an address of the server's own machine"),
        () if address.is_unicast_link_local() => Some("a link-local address"),
        () if parts[0] & 0xfe00 == 0xfc00 => Some("a unique-local address"),
        // Of what is given out to machines, 2000::/3, tunnels and documentation.
        () if parts[0] & 0xe000 != 0x2000 => Some("no address of a machine on the internet"),
        () if parts[0] == 0x2002 || parts[0] == 0x2001 && parts[1] < 0x200 || parts[..2] == [0x2001, 0xdb8] => {
            Some("an address for special purposes")
        }
        () => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_inside_is_refused() {
        for inside in [
            "127.0.0.1",
            "127.255.255.254",
            "10.0.0.1",
            "172.16.0.1",
            "172.31.255.255",
            "192.168.1.1",
            "169.254.169.254",
            "100.64.0.1",
            "100.100.100.200",
            "0.0.0.0",
            "224.0.0.1",
            "255.255.255.255",
            "192.0.2.1",
            "198.19.0.1",
            "203.0.113.5",
            "::",
            "::1",
            "::ffff:127.0.0.1",
            "::ffff:169.254.169.254",
            "::127.0.0.1",
            "64:ff9b::7f00:1",
            "fe80::1",
            "fec0::1",
            "fc00::1",
            "fd00:ec2::254",
            "ff02::1",
            "2001:db8::1",
            "2001:0:4136::1",
            "2002:7f00:1::1",
        ] {
            assert!(fault(inside.parse().unwrap(), &[]).is_some(), "{inside}");
        }
        for outside in ["1.1.1.1", "172.15.255.255", "172.32.0.1", "100.128.0.1", "2606:4700::1111", "2a00:1450::1"] {
            assert_eq!(fault(outside.parse().unwrap(), &[]), None, "{outside}");
        }
    }

    #[test]
    fn ranges_are_allowed_and_no_more() {
        let allowed = [range("10.1.0.0/16").unwrap(), range("::1").unwrap(), range("127.0.0.1").unwrap()];
        for address in ["10.1.2.3", "::1", "127.0.0.1", "::ffff:127.0.0.1"] {
            assert_eq!(fault(address.parse().unwrap(), &allowed), None, "{address}");
        }
        for address in ["10.2.0.1", "127.0.0.2", "fd00::1"] {
            assert!(fault(address.parse().unwrap(), &allowed).is_some(), "{address}");
        }
        assert!(range("10.1.0.0/33").is_err() && range("localhost").is_err());
    }
}
