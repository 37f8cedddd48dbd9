//! Compiles a function for the widest vector units that processors commonly have, beside the
//! portable form.

/// Defines a function that runs with AVX-512 or AVX2 where the processor has it. The first brackets
/// declare the generics, the second name them. No operation is contracted or reordered, so that results
/// are the same on every processor.
#[macro_export]
macro_rules! widest {
    (
        $(#[$meta:meta])*
        $vis:vis fn $name:ident [$($generics:tt)*] [$($names:tt)*] ($($arg:ident: $type:ty),* $(,)?) $(-> $result:ty)?
        $body:block
    ) => {
        $(#[$meta])*
        $vis fn $name<$($generics)*>($($arg: $type),*) $(-> $result)? {
            #[inline(always)]
            fn portable<$($generics)*>($($arg: $type),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2<$($generics)*>($($arg: $type),*) $(-> $result)? {
                    portable::<$($names)*>($($arg),*)
                }
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                fn avx512<$($generics)*>($($arg: $type),*) $(-> $result)? {
                    portable::<$($names)*>($($arg),*)
                }
                if $crate::maths::widest::has_avx512() {
                    // SAFETY: the processor has the features that the function was compiled for.
                    return unsafe { avx512::<$($names)*>($($arg),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has the feature that the function was compiled for.
                    return unsafe { avx2::<$($names)*>($($arg),*) };
                }
            }
            portable::<$($names)*>($($arg),*)
        }
    };
}

pub use widest;

/// Whether the processor has vectors of 512 bits, for numbers and for integers.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx512() -> bool {
    use std::arch::is_x86_feature_detected as has;
    has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl")
}
