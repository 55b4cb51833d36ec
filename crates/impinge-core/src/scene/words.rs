//! The words for the choices that users have: the same in every language; and types by their names.

/// Gives an enum its words: `ALL`, `name`, `Display` and `FromStr`. An unknown word is an
/// [`Error`](crate::Error) that names the setting and the words allowed.
macro_rules! words {
    ($setting:literal, $allowed:literal, $type:ident: [$($variant:ident = $word:literal),+; $n:literal]) => {
        impl $type {
            #[doc = concat!("All, in this order: ", $allowed, ".")]
            pub const ALL: [$type; $n] = [$($type::$variant),+];

            #[doc = concat!("The word for it in every language: ", $allowed, ".")]
            pub const fn name(self) -> &'static str {
                match self {
                    $($type::$variant => $word),+
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::scene::error::Error;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                let found = $type::ALL.into_iter().find(|one| one.name() == word);
                found.ok_or_else(|| $crate::scene::error::Error::Setting {
                    setting: $setting,
                    given: word.to_owned(),
                    allowed: $allowed,
                })
            }
        }

        #[cfg(feature = "serde")]
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                to.serialize_str(self.name())
            }
        }

        #[cfg(feature = "serde")]
        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                let word = <String as serde::Deserialize>::deserialize(from)?;
                word.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}
pub(crate) use words;

/// Gives types a `Debug` that says their name alone: what they hold is memory for later.
macro_rules! debug_by_name {
    ($($type:ty => $name:literal),+ $(,)?) => {$(
        impl std::fmt::Debug for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.debug_struct($name).finish_non_exhaustive()
            }
        }
    )+};
}
pub(crate) use debug_by_name;

#[cfg(test)]
mod tests {
    use crate::{Affinity, Backend, BodyKind, Error, InstructionSet, Method, PairKind, Precision};
    use crate::{Recluster, SharedVertex, Start};

    #[test]
    fn words_come_back_and_others_are_refused_by_name() {
        macro_rules! check {
            ($($type:ident),+) => {$(
                for one in $type::ALL {
                    assert_eq!(one.to_string().parse::<$type>(), Ok(one));
                    assert_eq!(one.to_string(), one.name());
                }
                let refused = "Nothing".parse::<$type>();
                assert!(matches!(refused, Err(Error::Setting { ref given, .. }) if given == "Nothing"), "{refused:?}");
            )+};
        }
        check!(
            Method,
            Backend,
            Recluster,
            InstructionSet,
            Affinity,
            SharedVertex,
            Start,
            Precision
        );
        check!(PairKind, BodyKind);
        let error = "never".parse::<Start>().unwrap_err().to_string();
        assert_eq!(error, "start: never given, report, skip or verify allowed");
    }
}
