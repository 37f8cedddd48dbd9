//! Compiling a function for the widest vectors that processors commonly have, beside the portable form.

/// Defines a function that runs with AVX2 where the processor has it. Generics are declared in the first brackets and
/// named in the second. No operation is contracted or reordered, so that the results are the same on every processor.
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
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has what the function was compiled for.
                    return unsafe { avx2::<$($names)*>($($arg),*) };
                }
            }
            portable::<$($names)*>($($arg),*)
        }
    };
}

pub use widest;
