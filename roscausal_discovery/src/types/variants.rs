//! What many types of settings have: choices that users write as words, and usual values.

/// The names of an enum's variants: `NAMES`, `name` and [`FromStr`](std::str::FromStr), which reads any case and other spellings, and names
/// the setting where a word is unknown.
#[doc(hidden)]
#[macro_export]
macro_rules! words {
    ($type:ident, $setting:literal: $($variant:ident $name:literal $(| $other:literal)*),+) => {
        impl $type {
            /// The names that users choose by.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// The name that users choose it by.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::Error;

            fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
                match text.to_ascii_lowercase().as_str() {
                    $($name $(| $other)* => Ok(Self::$variant),)+
                    _ => Err(Self::Err::unknown($setting, text, Self::NAMES)),
                }
            }
        }
    };
}

/// A struct that is checked when it is read: `Unchecked`, of the same fields, reads it as it is in a file. The name stands there twice, the
/// second time for serde.
macro_rules! read_unchecked {
    (
        $(#[$about:meta])*
        $seen:vis struct $type:ident $name:tt {
            $($(#[$of_field:meta])* $field_seen:vis $field:ident: $kind:ty),* $(,)?
        }
    ) => {
        $(#[$about])*
        $seen struct $type {
            $($(#[$of_field])* $field_seen $field: $kind,)*
        }

        #[derive(serde::Deserialize)]
        #[serde(remote = $name)]
        struct Unchecked {
            $($(#[$of_field])* $field: $kind,)*
        }
    };
}

/// A type that is a text in files: what it displays as and is read from.
macro_rules! as_text {
    ($type:ty) => {
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
                to.collect_str(self)
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
                let text = <std::borrow::Cow<'_, str> as serde::Deserialize>::deserialize(from)?;
                text.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}

/// A struct of settings whose fields have their usual value behind them, as in `pub tau_max: usize = 1,`; these are its [`Default`].
#[doc(hidden)]
#[macro_export]
macro_rules! with_defaults {
    (
        $(#[$about:meta])*
        $seen:vis struct $type:ident {
            $($(#[$of_field:meta])* $field_seen:vis $field:ident: $kind:ty = $usual:expr),* $(,)?
        }
    ) => {
        $(#[$about])*
        $seen struct $type {
            $($(#[$of_field])* $field_seen $field: $kind,)*
        }

        impl Default for $type {
            fn default() -> Self {
                Self { $($field: $usual),* }
            }
        }
    };
}
