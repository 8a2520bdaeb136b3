#include "streams/line_reader.hpp"

#include <limits.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

namespace twofold {
namespace {

// A terminal says that it has room as soon as it has this much (WAKEUP_CHARS of Linux).
constexpr std::size_t kTerminalRoom = 256;
constexpr std::size_t kFileChunk = std::size_t{1} << 20;

}  // namespace

LineReader::LineReader(FileDescriptor fd, PoseForm form) : fd_(std::move(fd)), form_(form) {
  struct stat kind {};
  (void)::fstat(fd_.get(), &kind);
  socket_ = S_ISSOCK(kind.st_mode);
  file_ = S_ISREG(kind.st_mode);
  chunk_ = S_ISFIFO(kind.st_mode) ? PIPE_BUF : S_ISCHR(kind.st_mode) ? kTerminalRoom : kFileChunk;
}

LineReader::~LineReader() {
  if (!fd_ || !file_ || begun_ == 0) return;
  const off_t end = ::lseek(fd_.get(), 0, SEEK_CUR);
  const auto whole = static_cast<off_t>(end - static_cast<off_t>(begun_));
  if (end >= 0 && ::ftruncate(fd_.get(), whole) == 0) (void)::lseek(fd_.get(), whole, SEEK_SET);
}

std::string LineReader::problem() const {
  const auto lines = missed_ + static_cast<std::uint64_t>(std::count(pending_.begin(), pending_.end(), '\n'));
  if (error_ == 0 || error_ == EPIPE || error_ == ECONNRESET || lines == 0) return "";
  return std::string(std::strerror(error_)) + ": the last " + std::to_string(lines) + " lines are missing";
}

void LineReader::offer(const std::string& lines) {
  if (lines.empty()) return;
  if (gone_) return miss(1);
  if (!flush()) {
    ++missed_;
    return;
  }
  pending_ = lines;
  (void)flush();
}

bool LineReader::flush() {
  if (send_pending() && missed_ > 0) pending_ = missed_line(std::exchange(missed_, 0), form_);
  return send_pending();
}

bool LineReader::send_pending() {
  std::size_t sent = 0;
  while (sent < pending_.size() && !gone_) {
    const std::size_t now = write_some(pending_.data() + sent, pending_.size() - sent);
    if (now == 0) break;
    const std::size_t line = std::string_view(pending_).substr(sent, now).rfind('\n');
    begun_ = line == std::string_view::npos ? begun_ + now : now - line - 1;
    sent += now;
  }
  pending_.erase(0, sent);
  return pending_.empty();
}

std::size_t LineReader::write_some(const char* bytes, std::size_t count) {
  ssize_t result = 0;
  if (socket_) {
    result = ::send(fd_.get(), bytes, count, MSG_DONTWAIT | MSG_NOSIGNAL);
  } else {
    // Not O_NONBLOCK: that would be seen by everybody who shares the file, the shell's terminal for one.
    pollfd room{fd_.get(), POLLOUT, 0};
    if (::poll(&room, 1, 0) != 1) return 0;
    result = ::write(fd_.get(), bytes, std::min(count, chunk_));
  }
  if (result > 0) error_ = 0;
  if (result >= 0) return static_cast<std::size_t>(result);
  const int error = errno;
  if (error == EAGAIN || error == EWOULDBLOCK || error == EINTR) return 0;
  error_ = error;
  gone_ = error != ENOSPC && error != EDQUOT && error != EFBIG;  // there may be room again
  return 0;
}

}  // namespace twofold
