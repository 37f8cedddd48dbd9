//! Secrets and signatures, as Standard Webhooks has them (<https://www.standardwebhooks.com>).

use base64::Engine;
use base64::alphabet;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use ring::hmac;
use ring::rand::{SecureRandom, SystemRandom};

const PREFIX: &str = "whsec_";
/// Some who make secrets leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);
/// Bytes of a new key.
const NEW: usize = 32;

/// The key that receivers check signatures by.
pub struct Secret(hmac::Key);

impl Secret {
    /// A new one, as text.
    pub fn make() -> Result<String, String> {
        let mut key = [0; NEW];
        SystemRandom::new().fill(&mut key).map_err(|_| "the system has no random numbers".to_owned())?;
        Ok(format!("{PREFIX}{}", BASE64.encode(key)))
    }

    pub fn read(text: &str) -> Result<Self, String> {
        let form = format!("a secret is `{PREFIX}` and 24 to 64 bytes in base64; leave it out, and one is made");
        let key = text.strip_prefix(PREFIX).and_then(|key| BASE64.decode(key).ok());
        let key = key.filter(|key| (24..=64).contains(&key.len())).ok_or(form)?;
        Ok(Self(hmac::Key::new(hmac::HMAC_SHA256, &key)))
    }

    /// The header `webhook-signature` of a message that is sent at a time (s since 1970).
    pub fn sign(&self, id: &str, time_s: i64, body: &str) -> String {
        let signed = format!("{id}.{time_s}.{body}");
        format!("v1,{}", BASE64.encode(hmac::sign(&self.0, signed.as_bytes())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_standard_is_signed_as_there() {
        let secret = Secret::read("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").unwrap();
        let body = r#"{"test": 2432232314}"#;
        let signature = secret.sign("msg_p5jXN8AQM9LWM0D4loKWxJek", 1_614_265_330, body);
        assert_eq!(signature, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    }

    #[test]
    fn secrets_have_a_form() {
        let made = [Secret::make().unwrap(), Secret::make().unwrap()];
        assert!(made[0] != made[1] && made.iter().all(|secret| Secret::read(secret).is_ok()));
        let padded = "whsec_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";
        assert!(Secret::read(padded).is_ok() && Secret::read(&format!("{padded}=")).is_ok());
        for wrong in ["", "whsec_", "whsec_c2hvcnQ=", "MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "whsec_?"] {
            assert!(Secret::read(wrong).is_err(), "{wrong}");
        }
    }
}
