#include "engine/logs/log_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace twofold {
namespace {

int open_file(const std::filesystem::path& file) {
  const int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (descriptor < 0)
    throw std::runtime_error(file.string() + ": cannot be written: " + std::strerror(errno));
  return descriptor;
}

/// Not every file system has files that never had a name: there it is taken away.
int open_unnamed(const std::filesystem::path& folder) {
  int descriptor = open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
  if (descriptor >= 0) return descriptor;
  std::string name = (folder / ".twofold-records-XXXXXX").string();
  descriptor = mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0)
    throw std::runtime_error(folder.string() + ": no file can be made in it: " + std::strerror(errno));
  (void)unlink(name.c_str());
  return descriptor;
}

/// @return bytes written; fewer than all with errno set
std::size_t write_all(int descriptor, std::span<const std::uint8_t> bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = write(descriptor, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

}  // namespace

LogFile::LogFile(std::string name, int descriptor) : name_(std::move(name)), descriptor_(descriptor) {}

LogFile::LogFile(const std::filesystem::path& file) : LogFile(file.string(), open_file(file)) {}

std::shared_ptr<LogFile> LogFile::unnamed(const std::filesystem::path& folder) {
  const std::string name = (folder / "(records of frames)").string();
  return std::shared_ptr<LogFile>(new LogFile(name, open_unnamed(folder)));
}

LogFile::~LogFile() {
  (void)close(descriptor_);
}

void LogFile::append(std::span<const std::uint8_t> bytes) {
  const std::scoped_lock lock(lock_);
  if (failure_.empty() && waiting_.size() + bytes.size() > kMostWaiting) failure_ = "the disk was too slow";
  if (!failure_.empty()) {
    lost_ += bytes.size();
    return;
  }
  waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
}

bool LogFile::behind() const {
  const std::scoped_lock lock(lock_);
  return waiting_.size() > kMostWaiting / 2;
}

void LogFile::write_waiting() {
  writing_.clear();
  {
    const std::scoped_lock lock(lock_);
    if (waiting_.empty()) return;
    waiting_.swap(writing_);
  }
  errno = 0;
  const std::size_t done = write_all(descriptor_, writing_);
  const int error = errno;
  const std::scoped_lock lock(lock_);
  written_ += done;
  if (done == writing_.size()) return;
  if (failure_.empty())
    failure_ = std::string("cannot be written: ") + std::strerror(error != 0 ? error : EIO);
  lost_ += writing_.size() - done + waiting_.size();
  waiting_.clear();
}

std::uint64_t LogFile::written() const {
  const std::scoped_lock lock(lock_);
  return written_;
}

std::string LogFile::error() const {
  const std::scoped_lock lock(lock_);
  if (lost_ == 0) return "";
  return name_ + ": " + failure_ + "; " + std::to_string(lost_) + " bytes are lost";
}

}  // namespace twofold
