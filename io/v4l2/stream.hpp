#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/v4l2/device.hpp"

namespace twofold {

enum class StreamStatus : std::uint8_t {
  kFrame,    ///< a whole image
  kDamaged,  ///< a frame came that cannot be used (flagged by the driver, or its size is wrong); the stream
             ///< goes on
  kTimeout,  ///< no frame yet
  kFailed,   ///< the stream is over: start a new one
  kGone,     ///< the device is gone: open it again once it is back
};

/// One answer of a stream.
struct StreamFrame {
  StreamStatus status = StreamStatus::kTimeout;
  std::string problem;  ///< for kDamaged, kFailed and kGone: one line
  std::span<const std::uint8_t>
      image{};                      ///< kFrame: in the driver's memory, until release, next wait, or the end
  std::int64_t t_ns = 0;            ///< kFrame, kDamaged: CLOCK_MONOTONIC
  bool stamped_on_arrival = false;  ///< the driver's time stamp cannot be used: t_ns is the time of arrival
  std::uint32_t lost = 0;           ///< frames that the sequence numbers say are missing before this one
};

/// Memory-mapped streaming from an open device, between STREAMON and STREAMOFF.
///
/// At any time at most one buffer is out of the driver's hands, which is why no image is copied here.
class V4l2Stream {
 public:
  /// Asks for `buffers` (2..32) buffers, maps and queues them, and starts. `device` outlives the stream.
  [[nodiscard]] static V4l2Expected<std::unique_ptr<V4l2Stream>> start(const V4l2Device& device,
                                                                       const ImageLayout& layout,
                                                                       int buffers);
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;
  ~V4l2Stream();

  /// Hands the last frame's buffer back and waits for the next frame. After kFailed and kGone only destroy
  /// it.
  [[nodiscard]] StreamFrame wait(int timeout_ms);
  /// Hands the last frame's buffer back, so that its image is no longer valid; false: the stream has failed.
  [[nodiscard]] bool release();

 private:
  struct Buffer {
    void* address = nullptr;
    std::size_t length = 0;
    bool queued = false;
  };

  V4l2Stream(const V4l2Device& device, const ImageLayout& layout) : device_(device), layout_(layout) {}
  [[nodiscard]] V4l2Expected<void> map_buffers(int count);
  [[nodiscard]] V4l2Expected<void> map_buffer(std::uint32_t index);
  [[nodiscard]] int queue(std::uint32_t index);
  [[nodiscard]] StreamFrame dequeue();
  [[nodiscard]] std::uint32_t count_lost(std::uint32_t sequence);
  void stamp(std::int64_t driver_ns, bool monotonic, StreamFrame* frame);
  [[nodiscard]] static StreamFrame failure(const std::string& what, int negative_errno);

  const V4l2Device& device_;
  ImageLayout layout_;
  std::vector<Buffer> buffers_;
  std::optional<std::uint32_t> held_;  // index of the buffer the caller looks at
  std::optional<std::uint32_t> last_sequence_;
  bool use_arrival_time_ = false;
  bool on_ = false;
};

}  // namespace twofold
