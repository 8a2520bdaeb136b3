#include "engine/logs/log_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "evaluation/tum_line.hpp"

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
std::size_t write_all(int descriptor, std::span<const std::uint8_t> bytes, std::uint64_t at) {
  std::size_t done = 0;
  errno = 0;
  while (done < bytes.size()) {
    const ssize_t n =
        pwrite(descriptor, bytes.data() + done, bytes.size() - done, static_cast<off_t>(at + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

}  // namespace

LogFile::LogFile(std::string name, int descriptor, LogContent content)
    : name_(std::move(name)), descriptor_(descriptor), content_(std::move(content)) {}

LogFile::LogFile(const std::filesystem::path& file, LogContent content)
    : LogFile(file.string(), open_file(file), std::move(content)) {}

std::shared_ptr<LogFile> LogFile::unnamed(const std::filesystem::path& folder, LogContent content) {
  const std::string name = (folder / ("(" + content.records + ")")).string();
  return std::shared_ptr<LogFile>(new LogFile(name, open_unnamed(folder), std::move(content)));
}

LogFile::~LogFile() {
  (void)close(descriptor_);
}

void LogFile::Loss::add(std::int64_t t_ns) {
  ++records;
  if (first_t_ns == kNoTime) first_t_ns = t_ns;
  if (t_ns != kNoTime) last_t_ns = t_ns;
}

bool LogFile::append(std::span<const std::uint8_t> bytes, std::int64_t t_ns) {
  const std::scoped_lock lock(lock_);
  const bool over = loss_.records > 0 && !content_.goes_on;
  if (over || in_hand_ + waiting_.bytes.size() + bytes.size() > kMostWaiting) {
    if (why_.empty()) why_ = blocked_.empty() ? "the disk was too slow" : blocked_;
    loss_.add(t_ns);
    return false;
  }
  waiting_.bytes.insert(waiting_.bytes.end(), bytes.begin(), bytes.end());
  waiting_.appends.push_back({static_cast<std::uint32_t>(bytes.size()), t_ns});
  return true;
}

bool LogFile::behind() const {
  const std::scoped_lock lock(lock_);
  return blocked_.empty() && in_hand_ + waiting_.bytes.size() > kMostWaiting / 2;
}

void LogFile::write_waiting() {
  if (write_batch()) (void)write_batch();  // what the disk did not take before, and what came since
}

bool LogFile::write_batch() {
  if (writing_.appends.empty()) {
    const std::scoped_lock lock(lock_);
    if (waiting_.appends.empty()) return false;
    std::swap(writing_, waiting_);
    in_hand_ = writing_.bytes.size();
    appends_in_hand_ = writing_.appends.size();
  }
  const std::uint64_t begin = written();
  const std::size_t done = write_all(descriptor_, writing_.bytes, begin);
  const int error = errno;
  const bool all = done == writing_.bytes.size();
  std::size_t whole = 0, appends = 0;
  for (; appends < writing_.appends.size() && whole + writing_.appends[appends].size <= done; ++appends)
    whole += writing_.appends[appends].size;
  if (done > whole) (void)ftruncate(descriptor_, static_cast<off_t>(begin + whole));
  using Offset = std::ptrdiff_t;
  writing_.bytes.erase(writing_.bytes.begin(), writing_.bytes.begin() + static_cast<Offset>(whole));
  writing_.appends.erase(writing_.appends.begin(), writing_.appends.begin() + static_cast<Offset>(appends));
  const std::scoped_lock lock(lock_);
  written_ += whole;
  in_hand_ = writing_.bytes.size();
  appends_in_hand_ = writing_.appends.size();
  blocked_ = all ? "" : std::strerror(error != 0 ? error : EIO);
  return all;
}

void LogFile::give_up() {
  const std::scoped_lock lock(lock_);
  for (Batch* batch : {&writing_, &waiting_}) {
    for (const Batch::Append& append : batch->appends) loss_.add(append.t_ns);
    *batch = {};
  }
  in_hand_ = appends_in_hand_ = 0;
  if (why_.empty()) why_ = blocked_;
  blocked_.clear();
}

std::uint64_t LogFile::written() const {
  const std::scoped_lock lock(lock_);
  return written_;
}

std::string LogFile::error() const {
  const std::scoped_lock lock(lock_);
  if (loss_.records == 0 && blocked_.empty()) return "";
  std::string text = name_ + ": " + (loss_.records > 0 ? why_ : blocked_);
  if (loss_.records > 0) {
    text += "; " + std::to_string(loss_.records) + " " + content_.records + " are missing";
    if (loss_.first_t_ns != kNoTime)
      text += ", from " + seconds_text(loss_.first_t_ns) + " s to " + seconds_text(loss_.last_t_ns) + " s";
    if (!content_.loss.empty()) text += ": " + content_.loss;
  }
  if (!blocked_.empty())
    text += "; " + std::to_string(appends_in_hand_ + waiting_.appends.size()) + " " + content_.records +
            " wait for room on the disk";
  return text;
}

}  // namespace twofold
