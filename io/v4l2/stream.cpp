#include "io/v4l2/stream.hpp"

#include <linux/videodev2.h>
#include <poll.h>

#include <cerrno>
#include <utility>

#include <fmt/format.h>

namespace twofold {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
/// A frame's stamp lies at most this far from the time of its arrival, or the stamps are of no use. Drivers
/// that stamp the end of the exposure ahead of time are a frame early; a program that was stopped reads old
/// frames.
constexpr std::int64_t kLargestLeadNs = 2 * kSecondNs;
constexpr std::int64_t kLargestAgeNs = 3600 * kSecondNs;

v4l2_buffer capture_buffer(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

bool sane_time(const timeval& time) {
  return time.tv_sec >= 0 && time.tv_sec < INT64_MAX / kSecondNs - 1 && time.tv_usec >= 0 &&
         time.tv_usec < 1'000'000;
}

}  // namespace

V4l2Expected<std::unique_ptr<V4l2Stream>> V4l2Stream::start(const V4l2Device& device,
                                                            const ImageLayout& layout, int buffers) {
  std::unique_ptr<V4l2Stream> stream(new V4l2Stream(device, layout));
  if (auto mapped = stream->map_buffers(buffers); !mapped) return tl::unexpected(mapped.error());
  for (std::uint32_t i = 0; i < stream->buffers_.size(); ++i) {
    if (const int result = stream->queue(i); result < 0) return tl::unexpected(call_error("QBUF", result));
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (const int result = device.calls().ioctl(device.fd(), VIDIOC_STREAMON, &type); result < 0) {
    return tl::unexpected(call_error("STREAMON", result));
  }
  stream->on_ = true;
  return stream;
}

V4l2Stream::~V4l2Stream() {
  // Each may fail on a device that is gone; the memory is ours to unmap all the same.
  V4l2Calls& calls = device_.calls();
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (on_) [[maybe_unused]]
    const int off = calls.ioctl(device_.fd(), VIDIOC_STREAMOFF, &type);
  for (const Buffer& buffer : buffers_) calls.munmap(buffer.address, buffer.length);
  v4l2_requestbuffers none{};
  none.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  none.memory = V4L2_MEMORY_MMAP;
  [[maybe_unused]] const int freed = calls.ioctl(device_.fd(), VIDIOC_REQBUFS, &none);
}

V4l2Expected<void> V4l2Stream::map_buffers(int count) {
  v4l2_requestbuffers request{};
  request.count = static_cast<std::uint32_t>(count);
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int result = device_.calls().ioctl(device_.fd(), VIDIOC_REQBUFS, &request); result < 0) {
    V4l2Error error = call_error("REQBUFS", result);
    if (result == -EBUSY) error.text += " (another program streams from it)";
    return tl::unexpected(error);
  }
  constexpr std::uint32_t kMostBuffers = 32;
  if (request.count < 2 || request.count > kMostBuffers) {
    return tl::unexpected(
        V4l2Error{0, fmt::format("gives {} buffers when asked for {}", request.count, count)});
  }
  for (std::uint32_t i = 0; i < request.count; ++i) {
    if (auto mapped = map_buffer(i); !mapped) return mapped;
  }
  return {};
}

V4l2Expected<void> V4l2Stream::map_buffer(std::uint32_t index) {
  v4l2_buffer query = capture_buffer(index);
  if (const int result = device_.calls().ioctl(device_.fd(), VIDIOC_QUERYBUF, &query); result < 0) {
    return tl::unexpected(call_error("QUERYBUF", result));
  }
  if (query.length < layout_.min_bytes()) {
    return tl::unexpected(V4l2Error{
        0, fmt::format("gives buffers of {} bytes for images of {}", query.length, layout_.min_bytes())});
  }
  void* address = nullptr;
  if (const int result = device_.calls().mmap(device_.fd(), query.length, query.m.offset, &address);
      result < 0) {
    return tl::unexpected(call_error("mmap", result));
  }
  buffers_.push_back({address, query.length, false});
  return {};
}

int V4l2Stream::queue(std::uint32_t index) {
  v4l2_buffer buffer = capture_buffer(index);
  const int result = device_.calls().ioctl(device_.fd(), VIDIOC_QBUF, &buffer);
  if (result == 0) buffers_[index].queued = true;
  return result;
}

StreamFrame V4l2Stream::failure(const std::string& what, int negative_errno) {
  const V4l2Error error = call_error(what, negative_errno);
  StreamFrame frame;
  frame.status = error.is_absence() ? StreamStatus::kGone : StreamStatus::kFailed;
  frame.problem = error.text;
  return frame;
}

bool V4l2Stream::release() {
  if (!held_) return true;
  const std::uint32_t index = *held_;
  if (queue(index) < 0) return false;
  held_.reset();
  return true;
}

StreamFrame V4l2Stream::wait(int timeout_ms) {
  if (held_) {
    if (const int result = queue(*held_); result < 0) return failure("QBUF", result);
    held_.reset();
  }
  short revents = 0;
  const int ready = device_.calls().poll(device_.fd(), timeout_ms, &revents);
  if (ready < 0) return failure("poll", ready);
  if (ready == 0) return {};
  // With POLLERR or POLLHUP the call below says what is the matter.
  StreamFrame frame = dequeue();
  if (frame.status == StreamStatus::kTimeout && (revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) {
    // Ready for ever but never with a frame: taken for a failure, or the caller would spin.
    frame = failure("poll reports an error", (revents & POLLHUP) != 0 ? -ENODEV : -EIO);
  }
  return frame;
}

StreamFrame V4l2Stream::dequeue() {
  v4l2_buffer buffer = capture_buffer(0);
  const int result = device_.calls().ioctl(device_.fd(), VIDIOC_DQBUF, &buffer);
  if (result == -EAGAIN) return {};
  if (result < 0) return failure("DQBUF", result);
  StreamFrame frame;
  if (buffer.index >= buffers_.size() || !buffers_[buffer.index].queued) {
    frame.status = StreamStatus::kFailed;
    frame.problem = fmt::format("DQBUF gives buffer {}, which was not queued", buffer.index);
    return frame;
  }
  Buffer& memory = buffers_[buffer.index];
  memory.queued = false;
  held_ = buffer.index;
  frame.lost = count_lost(buffer.sequence);
  const bool monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC &&
                         sane_time(buffer.timestamp);
  stamp(monotonic ? buffer.timestamp.tv_sec * kSecondNs + buffer.timestamp.tv_usec * 1000 : 0, monotonic,
        &frame);
  frame.status = StreamStatus::kDamaged;
  if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) {
    frame.problem = "the driver flagged a frame as damaged";
  } else if (buffer.bytesused < layout_.min_bytes() || buffer.bytesused > memory.length) {
    frame.problem = fmt::format("a frame has {} bytes, needs {}..{}", buffer.bytesused, layout_.min_bytes(),
                                memory.length);
  } else {
    frame.status = StreamStatus::kFrame;
    frame.image = {static_cast<const std::uint8_t*>(memory.address), buffer.bytesused};
  }
  return frame;
}

/// Sequence numbers wrap at 2^32. One that does not move forward was reset by the driver: nothing is known
/// then.
std::uint32_t V4l2Stream::count_lost(std::uint32_t sequence) {
  const std::optional<std::uint32_t> last = std::exchange(last_sequence_, sequence);
  if (!last) return 0;
  const std::uint32_t step = sequence - *last;
  constexpr std::uint32_t kBackwards = 1U << 31;
  return step == 0 || step >= kBackwards ? 0 : step - 1;
}

void V4l2Stream::stamp(std::int64_t driver_ns, bool monotonic, StreamFrame* frame) {
  const std::int64_t now_ns = device_.calls().now_ns();
  // Once without stamps, always: the two kinds in one stream would run out of order.
  if (!monotonic || driver_ns > now_ns + kLargestLeadNs || driver_ns < now_ns - kLargestAgeNs)
    use_arrival_time_ = true;
  frame->stamped_on_arrival = use_arrival_time_;
  frame->t_ns = use_arrival_time_ ? now_ns : driver_ns;
}

}  // namespace twofold
