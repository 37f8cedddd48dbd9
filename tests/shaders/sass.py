"""What NVIDIA's compiler makes of shaders, without a GPU: naga's HLSL → CUDA (Slang) → cubin (NVRTC) → SASS.

    python3 sass.py WHEELS sm_80,sm_90 a.hlsl b.hlsl …

WHEELS is where tests/shaders/nvidia installs nvidia.txt. A line of JSON with the versions, then one for each shader:
{"file": …, "sm_80": {"instructions": …, "registers": …, "stack": …, "shared": …}, …}. An error ends it with status 1.

Division and square root are as a graphics driver makes them. Instruction selection, registers and stack are those of ptxas;
a graphics driver's front end differs, its back end is the same.
"""

import ctypes
import glob
import json
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import distributions
from pathlib import Path

WHEELS = Path(sys.argv[1]).resolve()
ARCHITECTURES = sys.argv[2].split(",")
SLANG = WHEELS / "slangtorch" / "bin"
TOOLS = WHEELS / "triton" / "backends" / "nvidia" / "bin"
NVRTC = ctypes.CDLL(glob.glob(str(WHEELS / "nvidia" / "cuda_nvrtc" / "lib" / "libnvrtc.so.1*"))[0])
OPTIONS = ["-default-device", "-prec-div=false", "-prec-sqrt=false", "-ftz=true", "-w", "--std=c++17",
           f"-I{WHEELS}/nvidia/cuda_runtime/include"]

# What Slang's prelude lacks or does badly. It reads byte buffers a byte at a time, because it does not know their alignment; a
# Vulkan driver does. It rounds halves away from zero, which takes four instructions; WGSL's rounding to even takes one. And it
# has no shifts of signed vectors by unsigned ones.
MENDS = [
    ("return ::roundf(f);", "return ::rintf(f);"),
    ("memcpy(&data, ((const char*)this->data) + index, sizeof(T));",
     "{ uint32_t* q = (uint32_t*)&data; for (int i = 0; i < int(sizeof(T) / 4); i++) "
     "q[i] = ((const uint32_t*)this->data)[(index >> 2) + i]; }"),
    ("memcpy((char*)data + index, &value, sizeof(T));",
     "{ const uint32_t* q = (const uint32_t*)&value; for (int i = 0; i < int(sizeof(T) / 4); i++) "
     "((uint32_t*)data)[(index >> 2) + i] = q[i]; }"),
    ("return uint4{data[dataIdx], data[dataIdx + 1], data[dataIdx + 2], data[dataIdx + 3]};",
     "return *(const uint4*)(data + dataIdx);"),
    ("return uint2{data[dataIdx], data[dataIdx + 1]};", "return *(const uint2*)(data + dataIdx);"),
    ("SLANG_CUDA_VECTOR_INT_OPS(ulonglong)\n", "SLANG_CUDA_VECTOR_INT_OPS(ulonglong)\n" + "".join(
        f"__device__ inline int{n} operator{op}(int{n} a, uint{n} b) {{ return a {op} make_int{n}({fields}); }}\n"
        for n, fields in ((2, "b.x, b.y"), (3, "b.x, b.y, b.z"), (4, "b.x, b.y, b.z, b.w")) for op in ("<<", ">>"))),
]


def run(*command):
    ran = subprocess.run([str(c) for c in command], capture_output=True, text=True,
                         env=dict(os.environ, LD_LIBRARY_PATH=str(SLANG)))
    if ran.returncode:
        raise RuntimeError(f"{command[0]}: {ran.stdout[-2000:]}{ran.stderr[-2000:]}")
    return ran.stdout + ran.stderr


def cuda(shader, folder):
    out = folder / "kernel.cu"
    run(SLANG / "slangc", shader, "-entry", "main", "-stage", "compute", "-lang", "hlsl", "-target", "cuda", "-o", out)
    source = out.read_text()
    for old, new in MENDS:
        source = source.replace(old, new)
    return source


def cubin(source, architecture):
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    NVRTC.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"kernel.cu", 0, None, None)
    options = [o.encode() for o in [f"--gpu-architecture={architecture}", *OPTIONS]]
    failed = NVRTC.nvrtcCompileProgram(program, len(options), (ctypes.c_char_p * len(options))(*options))
    get = "ProgramLog" if failed else "CUBIN"
    getattr(NVRTC, f"nvrtcGet{get}Size")(program, ctypes.byref(size))
    out = ctypes.create_string_buffer(size.value)
    getattr(NVRTC, f"nvrtcGet{get}")(program, out)
    NVRTC.nvrtcDestroyProgram(ctypes.byref(program))
    if failed:
        raise RuntimeError(out.value.decode()[:2000])
    return out.raw


def figures(binary, folder):
    path = folder / "kernel.cubin"
    path.write_bytes(binary)
    used = re.search(r"REG:(\d+) STACK:(\d+) SHARED:(\d+)", run(TOOLS / "cuobjdump", "-res-usage", path))
    # An instruction's address, its predicate and its name; what pads the end of the code does not count.
    code = run(TOOLS / "nvdisasm", "-c", path)
    names = re.findall(r"/\*[0-9a-f]{4,}\*/\s+(?:@!?U?P\w+\s+)?([A-Z][A-Z0-9_.]*)", code)
    instructions = sum(name != "NOP" for name in names)
    return dict(zip(("registers", "stack", "shared"), map(int, used.groups())), instructions=instructions)


def measure(shader):
    try:
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            source = cuda(shader, folder)
            return {"file": os.path.basename(shader)} | {a: figures(cubin(source, a), folder) for a in ARCHITECTURES}
    except Exception as error:
        raise RuntimeError(f"{shader}: {error}") from error


def versions():
    installed = {d.metadata["Name"]: d.version for d in distributions(path=[str(WHEELS)])}
    return f"NVRTC {installed['nvidia-cuda-nvrtc-cu12']} after Slang {run(SLANG / 'slangc', '-v').strip()}"


for tool in (SLANG / "slangc", TOOLS / "cuobjdump", TOOLS / "nvdisasm"):
    tool.chmod(0o755)
print(json.dumps({"versions": versions()}), flush=True)
with ThreadPoolExecutor(os.cpu_count()) as pool:
    for row in pool.map(measure, sys.argv[3:]):
        print(json.dumps(row), flush=True)
