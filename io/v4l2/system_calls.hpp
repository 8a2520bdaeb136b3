#pragma once

#include <cstddef>
#include <cstdint>

namespace twofold {

/// The system calls that capture is made of, and the clock it waits by, as a seam: tests put a device of
/// their own behind it. Results are 0 (or what is stated) on success and -errno on failure; EINTR never comes
/// out.
class V4l2Calls {
 public:
  virtual ~V4l2Calls() = default;

  /// A descriptor >= 0, opened for reading and writing, non-blocking, closed on exec.
  [[nodiscard]] virtual int open(const char* path) = 0;
  virtual void close(int fd) = 0;
  [[nodiscard]] virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
  /// Maps `length` bytes of the device's memory, readable, shared.
  [[nodiscard]] virtual int mmap(int fd, std::size_t length, std::int64_t offset, void** address) = 0;
  virtual void munmap(void* address, std::size_t length) = 0;
  /// Waits for something to read: 1 and revents, 0 after timeout_ms.
  [[nodiscard]] virtual int poll(int fd, int timeout_ms, short* revents) = 0;

  /// CLOCK_MONOTONIC [ns].
  [[nodiscard]] virtual std::int64_t now_ns() = 0;
  virtual void sleep_ms(int duration_ms) = 0;
};

/// The kernel's own.
class SystemV4l2Calls final : public V4l2Calls {
 public:
  [[nodiscard]] int open(const char* path) override;
  void close(int fd) override;
  [[nodiscard]] int ioctl(int fd, unsigned long request, void* argument) override;
  [[nodiscard]] int mmap(int fd, std::size_t length, std::int64_t offset, void** address) override;
  void munmap(void* address, std::size_t length) override;
  [[nodiscard]] int poll(int fd, int timeout_ms, short* revents) override;
  [[nodiscard]] std::int64_t now_ns() override;
  void sleep_ms(int duration_ms) override;
};

}  // namespace twofold
