//! Parameters of a module, declared once: field, words and default stand in one place.

/// Declares the type of a module: each field with its doc comment, which people also read in forms and messages, and
/// its default value.
///
/// The type derives `Reflect`, `Debug`, `Clone`, `PartialEq`, `Serialize` and `Deserialize`, implements `Default`, and
/// has a constant `PARAMETERS` for [`RigModule::PARAMETERS`](crate::processor::RigModule::PARAMETERS). `bevy` and
/// `serde` have to be dependencies of the crate that uses it.
///
/// ```
/// rigsmith::parameters! {
///     /// Hangs a weight below nodes.
///     pub struct Pendulum {
///         /// Distance of the weight below the node, above 0, in the rig's units.
///         pub length: f32 = 0.3,
///     }
/// }
/// assert_eq!(Pendulum::default().length, 0.3);
/// assert!(Pendulum::PARAMETERS[0].1.contains("Distance"));
/// ```
#[macro_export]
macro_rules! parameters {
    (
        $(#[$meta:meta])*
        $visibility:vis struct $Name:ident {
            $(
                $(#[doc = $doc:literal])+
                $field_visibility:vis $field:ident: $Type:ty = $default:expr
            ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(::bevy::reflect::Reflect, Debug, Clone, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        $visibility struct $Name {
            $($(#[doc = $doc])+ $field_visibility $field: $Type,)*
        }

        impl Default for $Name {
            fn default() -> Self {
                Self { $($field: $default),* }
            }
        }

        impl $Name {
            /// Name and description of each parameter.
            pub const PARAMETERS: &'static [(&'static str, &'static str)] =
                &[$((stringify!($field), concat!($($doc),+))),*];
        }
    };
}
