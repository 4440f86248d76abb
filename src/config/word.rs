//! Parameters whose value is one of a few words: each type has one list of them, from which they are told and read.

use super::{Kind, Value};
use crate::cloud::{CloudFilter, Optical};
use crate::engine::{Mode, NoiseModel, Params};

/// A type whose values are words of a parameter.
pub(super) trait Word: Copy + 'static {
    /// All values, in the order of the documentation.
    const ALL: &'static [Self];
    /// Their words.
    const WORDS: &'static [&'static str];
    /// The word of the default.
    const DEFAULT: &'static str;

    /// The word of this value.
    fn word(self) -> &'static str;

    /// The value of a word; `None` where no value has it.
    fn of_word(word: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|value| value.word() == word)
    }
}

/// A type's default and its list: a value that is missing there does not compile.
macro_rules! words {
    ($type:ty, $default:expr, { $($value:ident => $word:expr),+ }) => {
        impl Word for $type {
            const ALL: &'static [Self] = &[$(Self::$value),+];
            const WORDS: &'static [&'static str] = &[$($word),+];
            const DEFAULT: &'static str = match $default {
                $(Self::$value => $word),+
            };

            fn word(self) -> &'static str {
                match self {
                    $(Self::$value => $word),+
                }
            }
        }

        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::Text(value.word().to_owned())
            }
        }
    };
}

// The engine has the words of these two: it names them where it refuses a saved map.
words!(Mode, Params::DEFAULT.mode(), {
    Consistent => Mode::Consistent.as_str(),
    Paper => Mode::Paper.as_str()
});
words!(NoiseModel, Params::DEFAULT.noise_model(), {
    KinectV1 => NoiseModel::KinectV1.as_str(),
    None => NoiseModel::None.as_str()
});
words!(Optical, CloudFilter::DEFAULT.optical, { Auto => "auto", Yes => "yes", No => "no" });
words!(Kind, Kind::Cloud, { Cloud => "cloud", Depth => "depth", Auto => "auto" });

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use super::*;

    fn check<T: Word + Debug + PartialEq>() {
        assert_eq!(T::ALL.len(), T::WORDS.len());
        for (value, word) in T::ALL.iter().zip(T::WORDS) {
            assert_eq!((value.word(), T::of_word(word)), (*word, Some(*value)));
        }
        assert!(T::of_word(T::DEFAULT).is_some());
        assert_eq!(T::of_word("other"), None);
    }

    #[test]
    fn each_word_stands_for_its_value_and_another_for_none() {
        check::<Mode>();
        check::<NoiseModel>();
        check::<Optical>();
        check::<Kind>();
    }
}
