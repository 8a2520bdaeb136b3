#include "io/bags/bag_file.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <utility>

#include "io/files/io_error.hpp"

namespace twofold {

BagFile::BagFile(const std::filesystem::path& file) : name_(file.string()) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (descriptor < 0 || fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    const bool folder = descriptor >= 0 && S_ISDIR(status.st_mode);
    if (descriptor >= 0) (void)close(descriptor);
    if (folder) throw IoError(file, "is a folder, not a file");
    throw IoError(file, "no such file, or it cannot be read");
  }
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size == 0) {
    (void)close(descriptor);
    throw IoError(file, "the file is empty");
  }
  // The pages are read as they are used, and are the kernel's to drop.
  void* const data = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
  (void)close(descriptor);
  if (data == MAP_FAILED) throw IoError(file, "cannot be read");
  (void)madvise(data, size, MADV_SEQUENTIAL);
  bytes_ = {static_cast<const std::uint8_t*>(data), size};
  mapped_ = true;
}

BagFile::~BagFile() {
  if (mapped_) (void)munmap(const_cast<std::uint8_t*>(bytes_.data()), bytes_.size());
}

BagFile::BagFile(BagFile&& other) noexcept
    : name_(std::move(other.name_)), bytes_(other.bytes_), mapped_(std::exchange(other.mapped_, false)) {}

std::span<const std::uint8_t> BagFile::part(std::uint64_t begin, std::uint64_t size) const {
  if (begin > bytes_.size() || size > bytes_.size() - begin) fail(begin, "ends in the middle");
  return bytes_.subspan(begin, size);
}

void BagFile::fail(std::uint64_t at, const std::string& what) const {
  throw IoError(std::filesystem::path(name_), what + " (byte " + std::to_string(at) + ")");
}

}  // namespace twofold
