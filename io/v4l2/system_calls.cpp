#include "io/v4l2/system_calls.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <thread>

namespace twofold {

int SystemV4l2Calls::open(const char* path) {
  int fd = -1;
  do {
    fd = ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
  } while (fd < 0 && errno == EINTR);
  return fd < 0 ? -errno : fd;
}

void SystemV4l2Calls::close(int fd) {
  ::close(fd);  // not repeated on EINTR: Linux has freed the descriptor by then
}

int SystemV4l2Calls::ioctl(int fd, unsigned long request, void* argument) {
  int result = -1;
  do {
    result = ::ioctl(fd, request, argument);
  } while (result < 0 && errno == EINTR);
  return result < 0 ? -errno : 0;
}

int SystemV4l2Calls::mmap(int fd, std::size_t length, std::int64_t offset, void** address) {
  // Writable as well: some drivers refuse a mapping that is not.
  void* mapped = ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
  if (mapped == MAP_FAILED) return -errno;
  *address = mapped;
  return 0;
}

void SystemV4l2Calls::munmap(void* address, std::size_t length) {
  ::munmap(address, length);
}

int SystemV4l2Calls::poll(int fd, int timeout_ms, short* revents) {
  const std::int64_t end_ns = now_ns() + std::int64_t{timeout_ms} * 1'000'000;
  pollfd entry{fd, POLLIN, 0};
  for (;;) {
    const std::int64_t left_ms = (end_ns - now_ns() + 999'999) / 1'000'000;
    const int result = ::poll(&entry, 1, left_ms > 0 ? static_cast<int>(left_ms) : 0);
    if (result < 0 && errno == EINTR)
      continue;  // a signal; the caller looks at its stop flag after the time out
    *revents = entry.revents;
    return result < 0 ? -errno : result;
  }
}

std::int64_t SystemV4l2Calls::now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void SystemV4l2Calls::sleep_ms(int duration_ms) {
  std::this_thread::sleep_for(std::chrono::milliseconds(duration_ms));
}

}  // namespace twofold
