#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/v4l2/system_calls.hpp"

namespace twofold {

/// What the fake driver answers a DQBUF with. Defaults are those of a faultless camera.
struct FakeFrame {
  std::vector<std::uint8_t> bytes;
  std::optional<std::uint32_t> bytesused;  ///< default: bytes.size()
  std::uint32_t skip = 0;                  ///< sequence numbers left out before this frame
  std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::optional<std::int64_t> t_ns;    ///< default: the time it is ready
  std::optional<std::uint32_t> index;  ///< default: the buffer queued longest ago
  int dqbuf_error = 0;                 ///< errno: DQBUF fails instead
  std::int64_t delay_ns = 0;           ///< comes later than it should
};

/// A V4L2 driver of one process: the answers of a camera in virtual time. Everything can be set wrong by the
/// test.
class FakeV4l2 final : public V4l2Calls {
 public:
  struct Device {
    std::string card = "fake camera";
    std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    std::vector<std::uint32_t> formats{V4L2_PIX_FMT_GREY};
    std::uint32_t width = 64, height = 48;
    std::uint32_t stride = 0;  ///< answered by S_FMT; 0: width * bytes a pixel
    std::uint32_t bytes_per_pixel = 1;
    std::uint32_t buffer_bytes = 64 * 48 * 4;
    std::optional<std::uint32_t> force_width;   ///< S_FMT's own idea
    std::optional<std::uint32_t> buffer_count;  ///< REQBUFS' own idea
    double fps = 25;
    std::uint32_t first_sequence = 0;
    std::map<unsigned long, std::vector<int>> errors;  ///< errno of the next calls of a request, 0 = succeed
    std::function<FakeFrame(std::uint64_t)> frame;     ///< k-th frame since the device was made
    std::int64_t absent_until_ns = -1;                 ///< unplugged until then
    std::map<std::uint32_t, v4l2_queryctrl> controls;
    std::map<std::uint32_t, std::int32_t> values;

    // State.
    std::uint64_t produced = 0;
    bool open = false, streaming = false;
    std::uint32_t sequence = 0;
    std::int64_t next_ns = 0;
    std::vector<std::vector<std::uint8_t>> memory;
    std::vector<std::uint32_t> queued;
    std::uint32_t pixelformat = 0;
  };

  std::map<std::string, Device> devices;
  std::int64_t time_ns = 1'000'000'000'000;
  int open_descriptors = 0;
  int mapped = 0;
  int sleeps = 0;

  [[nodiscard]] int open(const char* path) override;
  void close(int fd) override;
  [[nodiscard]] int ioctl(int fd, unsigned long request, void* argument) override;
  [[nodiscard]] int mmap(int fd, std::size_t length, std::int64_t offset, void** address) override;
  void munmap(void* address, std::size_t length) override;
  [[nodiscard]] int poll(int fd, int timeout_ms, short* revents) override;
  [[nodiscard]] std::int64_t now_ns() override { return time_ns; }
  void sleep_ms(int duration_ms) override {
    ++sleeps;
    time_ns += std::int64_t{duration_ms} * 1'000'000;
  }

 private:
  [[nodiscard]] int set_format(Device& device, v4l2_format* format);
  [[nodiscard]] int dequeue(Device& device, v4l2_buffer* buffer);
  [[nodiscard]] bool gone(const Device& device) const { return time_ns < device.absent_until_ns; }

  std::map<int, std::string> descriptors_;
  std::map<std::string, FakeFrame> pending_;  // ready or awaited, one a device
  int next_fd_ = 100;
};

}  // namespace twofold
