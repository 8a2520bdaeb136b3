#include "engine/logs/mapped_file.hpp"

#include <sys/mman.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

namespace twofold {

MappedFile::MappedFile(const LogFile& file) {
  const std::size_t size = file.written();
  if (size == 0) return;  // there is no mapping of nothing
  void* const data = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file.descriptor(), 0);
  if (data == MAP_FAILED)
    throw std::runtime_error(std::string("the run's records cannot be read back: ") + std::strerror(errno));
  bytes_ = {static_cast<std::uint8_t*>(data), size};
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) (void)munmap(bytes_.data(), bytes_.size());
}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

}  // namespace twofold
