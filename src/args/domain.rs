//! `ROS_DOMAIN_ID`, read as ROS itself reads it: by C's `strtoul`, which goes by how a number begins. But what follows the number, which
//! ROS passes over, is refused.

use super::ArgsError;

/// The largest that DDS has ports for.
const LARGEST: u64 = 232;

/// The domain that this text stands for, 0 where it is empty; and what is to be said of one that reads like another.
///
/// # Errors
/// Where it is no number from 0 to 232.
pub(super) fn parse(text: &str) -> Result<(u16, Option<String>), ArgsError> {
    if text.is_empty() {
        return Ok((0, None));
    }
    let domain = unsigned(text).filter(|domain| *domain <= LARGEST).and_then(|domain| domain.try_into().ok());
    let domain: u16 = domain.ok_or_else(|| ArgsError::Domain(text.to_owned()))?;
    let in_decimal =
        text.trim_start_matches(is_space).parse().ok().filter(|number: &u64| *number != u64::from(domain));
    let line = in_decimal.map(|number| {
        format!("ROS_DOMAIN_ID is {text:?}, which is domain {domain} and not {number}: as in C a number that begins with 0 is octal")
    });
    Ok((domain, line))
}

/// The whole text as a number as `strtoul` reads it with base 0: after spaces and a sign, `0x` begins a hexadecimal one and 0 an octal
/// one.
fn unsigned(text: &str) -> Option<u64> {
    let text = text.trim_start_matches(is_space);
    let (is_negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let hexadecimal = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X"));
    let (digits, base) = match hexadecimal {
        Some(digits) => (digits, 16),
        None => (digits, if digits.starts_with('0') { 8 } else { 10 }),
    };
    // A second sign is none to C.
    let number = Some(digits).filter(|digits| digits.starts_with(|c: char| c.is_ascii_hexdigit()));
    let number = u64::from_str_radix(number?, base).ok()?;
    Some(if is_negative { number.wrapping_neg() } else { number })
}

/// Whether C passes over it before a number.
const fn is_space(c: char) -> bool {
    matches!(c, ' ' | '\t'..='\r')
}
