#include "doctor/disk.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>

#include <fmt/format.h>

namespace twofold {
namespace {

/// An open file that is gone when this is.
class ScratchFile {
 public:
  explicit ScratchFile(const std::filesystem::path& folder)
      : path_((folder / "twofold-doctor-XXXXXX").string()) {
    fd_ = mkstemp(path_.data());
    if (fd_ >= 0) unlink(path_.c_str());
  }
  ~ScratchFile() {
    if (fd_ >= 0) close(fd_);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  [[nodiscard]] bool is_open() const { return fd_ >= 0; }
  /// 0, or errno.
  [[nodiscard]] int write_and_sync(std::size_t bytes) const {
    std::vector<char> block(std::size_t{1} << 20U);
    for (std::size_t i = 0; i < block.size(); ++i) block[i] = static_cast<char>((i * 2654435761U) >> 13U);
    while (bytes > 0) {
      const ssize_t n = write(fd_, block.data(), std::min(bytes, block.size()));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return errno;
      bytes -= static_cast<std::size_t>(n);
    }
    return fdatasync(fd_) == 0 ? 0 : errno;
  }

 private:
  std::string path_;
  int fd_ = -1;
};

}  // namespace

Finding check_disk(const std::filesystem::path& folder, double needed_bytes_per_second, std::size_t bytes) {
  const std::string subject = "disk " + folder.string();
  const ScratchFile file(folder);
  if (!file.is_open())
    return {Health::kBad, subject, std::strerror(errno), "name a folder that can be written to"};
  const auto begin = std::chrono::steady_clock::now();
  if (const int error = file.write_and_sync(bytes); error != 0)
    return {Health::kBad, subject, std::strerror(error), "make room, or record elsewhere"};
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double speed = static_cast<double>(bytes) / std::max(seconds, 1e-6);
  const std::string state = fmt::format("writes {:.0f} MB/s, recording needs up to {:.0f}", 1e-6 * speed,
                                        1e-6 * needed_bytes_per_second);
  if (speed >= 2 * needed_bytes_per_second) return {Health::kOk, subject, state, ""};
  return {speed >= needed_bytes_per_second ? Health::kWarn : Health::kBad, subject, state,
          "record to a faster disk, or a smaller size or rate"};
}

}  // namespace twofold
