// libFuzzer target for PLY files: whatever the bytes, they are read or refused with an IoError, and what is
// read is whole.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/files/ply.hpp"

namespace {

using namespace twofold;

void expect(bool condition) {
  if (!condition) std::abort();
}

void read_mesh(const std::filesystem::path& file) {
  try {
    const TriangleMesh mesh = read_ply_mesh(file);
    const std::size_t vertices = mesh.positions.size();
    for (const auto& x : mesh.positions) expect(x.allFinite());
    expect(mesh.normals.empty() || mesh.normals.size() == vertices);
    expect(mesh.colours.empty() || mesh.colours.size() == vertices);
    for (const auto& t : mesh.triangles)
      for (const std::uint32_t v : t) expect(v < vertices);
  } catch (const IoError&) {
  }
}

void read_points(const std::filesystem::path& file) {
  try {
    (void)read_ply(file);
  } catch (const IoError&) {
  }
}

/// In memory: the readers want files.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("fuzz", 0)) { expect(descriptor_ >= 0); }
  ~MemoryFile() { close(descriptor_); }
  void fill(const std::uint8_t* data, std::size_t size) const {
    expect(ftruncate(descriptor_, 0) == 0);
    expect(pwrite(descriptor_, data, size, 0) == static_cast<ssize_t>(size));
  }
  [[nodiscard]] std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const MemoryFile file;
  file.fill(data, size);
  read_mesh(file.path());
  read_points(file.path());
  return 0;
}
