#include "tests/io/v4l2/fake_device.hpp"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace twofold {
namespace {

void copy_text(const std::string& text, std::uint8_t* field, std::size_t size) {
  std::memcpy(field, text.data(), std::min(text.size(), size));
}

}  // namespace

int FakeV4l2::open(const char* path) {
  const auto device = devices.find(path);
  if (device == devices.end() || gone(device->second)) return -ENOENT;
  if (device->second.open) return -EBUSY;
  device->second.open = true;
  ++open_descriptors;
  descriptors_[next_fd_] = path;
  return next_fd_++;
}

void FakeV4l2::close(int fd) {
  Device& device = devices.at(descriptors_.at(fd));
  device.open = device.streaming = false;
  pending_.erase(descriptors_.at(fd));
  descriptors_.erase(fd);
  --open_descriptors;
}

int FakeV4l2::set_format(Device& device, v4l2_format* format) {
  v4l2_pix_format& pixels = format->fmt.pix;
  if (std::find(device.formats.begin(), device.formats.end(), pixels.pixelformat) == device.formats.end()) {
    pixels.pixelformat = device.formats.front();
  }
  device.pixelformat = pixels.pixelformat;
  pixels.width = device.force_width.value_or(device.width);
  pixels.height = device.height;
  pixels.bytesperline = device.stride > 0 ? device.stride : device.width * device.bytes_per_pixel;
  pixels.sizeimage = device.buffer_bytes;
  return 0;
}

int FakeV4l2::ioctl(int fd, unsigned long request, void* argument) {
  Device& device = devices.at(descriptors_.at(fd));
  if (gone(device)) return -ENODEV;
  if (auto& errors = device.errors[request]; !errors.empty()) {
    const int error = errors.front();
    errors.erase(errors.begin());
    if (error != 0) return -error;
  }
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto* answer = static_cast<v4l2_capability*>(argument);
      copy_text(device.card, answer->card, sizeof answer->card);
      copy_text("fake", answer->driver, sizeof answer->driver);
      answer->capabilities = V4L2_CAP_DEVICE_CAPS;
      answer->device_caps = device.capabilities;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      auto* entry = static_cast<v4l2_fmtdesc*>(argument);
      if (entry->index >= device.formats.size()) return -EINVAL;
      entry->pixelformat = device.formats[entry->index];
      return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      auto* entry = static_cast<v4l2_frmsizeenum*>(argument);
      if (entry->index > 0) return -EINVAL;
      entry->type = V4L2_FRMSIZE_TYPE_DISCRETE;
      entry->discrete = {device.width, device.height};
      return 0;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
      auto* entry = static_cast<v4l2_frmivalenum*>(argument);
      if (entry->index > 0) return -EINVAL;
      entry->type = V4L2_FRMIVAL_TYPE_DISCRETE;
      entry->discrete = {1000, static_cast<std::uint32_t>(device.fps * 1000)};
      return 0;
    }
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT:
      return set_format(device, static_cast<v4l2_format*>(argument));
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      auto* parameters = static_cast<v4l2_streamparm*>(argument);
      parameters->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
      parameters->parm.capture.timeperframe = {1000, static_cast<std::uint32_t>(device.fps * 1000)};
      return 0;
    }
    case VIDIOC_QUERYCTRL: {
      auto* query = static_cast<v4l2_queryctrl*>(argument);
      const bool next = (query->id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0;
      const std::uint32_t id = query->id & V4L2_CTRL_ID_MASK;
      const auto found = next ? device.controls.upper_bound(id) : device.controls.find(id);
      if (found == device.controls.end()) return -EINVAL;
      *query = found->second;
      query->id = found->first;
      return 0;
    }
    case VIDIOC_G_CTRL:
    case VIDIOC_S_CTRL: {
      auto* control = static_cast<v4l2_control*>(argument);
      if (!device.controls.contains(control->id)) return -EINVAL;
      if (request == VIDIOC_S_CTRL) device.values[control->id] = control->value;
      control->value = device.values[control->id];
      return 0;
    }
    case VIDIOC_REQBUFS: {
      auto* buffers = static_cast<v4l2_requestbuffers*>(argument);
      if (buffers->count > 0 && device.buffer_count) buffers->count = *device.buffer_count;
      device.memory.assign(buffers->count, std::vector<std::uint8_t>(device.buffer_bytes));
      device.queued.clear();
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      auto* buffer = static_cast<v4l2_buffer*>(argument);
      buffer->length = device.buffer_bytes;
      buffer->m.offset = buffer->index << 16;
      return 0;
    }
    case VIDIOC_QBUF:
      device.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
      return 0;
    case VIDIOC_DQBUF:
      return dequeue(device, static_cast<v4l2_buffer*>(argument));
    case VIDIOC_STREAMON:
      device.streaming = true;
      device.sequence = device.first_sequence;
      device.next_ns = time_ns + std::llround(1e9 / device.fps);
      return 0;
    case VIDIOC_STREAMOFF:
      device.streaming = false;
      return 0;
    default:
      return -ENOTTY;
  }
}

int FakeV4l2::dequeue(Device& device, v4l2_buffer* buffer) {
  const std::string& path = std::find_if(devices.begin(), devices.end(), [&](const auto& entry) {
                              return &entry.second == &device;
                            })->first;
  const auto pending = pending_.find(path);
  if (pending == pending_.end() || time_ns < device.next_ns || device.queued.empty()) return -EAGAIN;
  const FakeFrame frame = pending->second;
  const std::int64_t ready_ns = device.next_ns;
  pending_.erase(pending);
  device.next_ns += std::llround(1e9 / device.fps) * (1 + frame.skip);
  if (frame.dqbuf_error != 0) return -frame.dqbuf_error;
  const std::uint32_t slot = device.queued.front();
  device.queued.erase(device.queued.begin());
  std::copy_n(frame.bytes.begin(), std::min(frame.bytes.size(), device.memory[slot].size()),
              device.memory[slot].begin());
  device.sequence += frame.skip;
  buffer->index = frame.index.value_or(slot);
  buffer->sequence = device.sequence++;
  buffer->flags = frame.flags;
  buffer->bytesused = frame.bytesused.value_or(static_cast<std::uint32_t>(frame.bytes.size()));
  const std::int64_t t_ns = frame.t_ns.value_or(ready_ns);
  buffer->timestamp = {t_ns / 1'000'000'000, t_ns % 1'000'000'000 / 1000};
  return 0;
}

int FakeV4l2::mmap(int fd, std::size_t length, std::int64_t offset, void** address) {
  Device& device = devices.at(descriptors_.at(fd));
  auto& memory = device.memory.at(static_cast<std::size_t>(offset >> 16));
  if (length > memory.size()) return -EINVAL;
  *address = memory.data();
  ++mapped;
  return 0;
}

void FakeV4l2::munmap(void*, std::size_t) {
  --mapped;
}

int FakeV4l2::poll(int fd, int timeout_ms, short* revents) {
  const std::string& path = descriptors_.at(fd);
  Device& device = devices.at(path);
  const std::int64_t end_ns = time_ns + std::int64_t{timeout_ms} * 1'000'000;
  *revents = 0;
  if (gone(device) || !device.streaming) {
    *revents = POLLERR | POLLHUP;
    return 1;
  }
  if (!pending_.contains(path)) {
    FakeFrame frame = device.frame(device.produced++);
    device.next_ns += frame.delay_ns;
    pending_.emplace(path, std::move(frame));
  }
  if (device.queued.empty() || device.next_ns > end_ns) {
    time_ns = end_ns;
    return 0;
  }
  time_ns = std::max(time_ns, device.next_ns);
  *revents = POLLIN;
  return 1;
}

}  // namespace twofold
