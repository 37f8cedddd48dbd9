//! Every program of the GPU engines, for those who look at shaders: tests and compilers.

use crate::explicit::gpu as explicit;
use crate::gpu::{Shader, Variant, WORKGROUP};
use crate::implicit::gpu as implicit;

/// All programs in samples of the variants that GPUs run; programs that come out the same in several are there
/// once. Errors: what is wrong with a shader.
pub fn programs() -> Result<Vec<Shader>, String> {
    let mut all: Vec<Shader> = Vec::new();
    let mut add = |mut names: Vec<&'static str>, variants: Vec<Variant>| -> Result<(), String> {
        names.sort_unstable();
        names.dedup();
        for (variant, name) in variants.iter().flat_map(|v| names.iter().map(move |name| (*v, *name))) {
            let shader = Shader::new(name, variant, WORKGROUP).map_err(|e| format!("{name}: {e}"))?;
            if !all.iter().any(|known| known.wgsl == shader.wgsl && known.constants == shader.constants) {
                all.push(shader);
            }
        }
        Ok(())
    };
    add(explicit::programs(), Variant::samples().collect())?;
    let implicit = [implicit::stages::programs(), implicit::linear::stages::programs()].concat();
    add(implicit, Variant::coarse_ones().collect())?;
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{STORAGE_BUFFERS, WORKGROUP_BYTES, file, files};

    #[test]
    fn programs_are_valid_and_fit_devices() {
        let programs = programs().unwrap_or_else(|e| panic!("{e}"));
        for shader in &programs {
            let (buffers, bytes) = (shader.storage_buffers(), shader.workgroup_bytes);
            assert!(buffers <= STORAGE_BUFFERS as usize, "{} binds {buffers} storage buffers", shader.name);
            assert!(bytes <= WORKGROUP_BYTES, "{} has {bytes} bytes of workgroup memory", shader.name);
        }
        let most = |of: fn(&Shader) -> usize| programs.iter().map(of).max();
        println!("{} programs, at most {:?} storage buffers", programs.len(), most(Shader::storage_buffers));
    }

    #[test]
    fn every_file_is_used() {
        let programs = programs().unwrap();
        for name in files() {
            let text = file(name).unwrap();
            assert!(programs.iter().any(|shader| shader.wgsl.contains(text)), "no program uses wgsl/{name}.wgsl");
        }
    }
}
