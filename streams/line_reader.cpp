#include "streams/line_reader.hpp"

#include <limits.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>

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
  chunk_ = S_ISFIFO(kind.st_mode) ? PIPE_BUF : S_ISCHR(kind.st_mode) ? kTerminalRoom : kFileChunk;
}

void LineReader::offer(const std::string& lines) {
  if (lines.empty() || gone_) return;
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
  if (result >= 0) return static_cast<std::size_t>(result);
  gone_ = errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR;
  return 0;
}

}  // namespace twofold
