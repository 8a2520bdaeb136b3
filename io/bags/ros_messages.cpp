#include "io/bags/ros_messages.hpp"

#include <algorithm>
#include <bit>

#include "base/bytes.hpp"

namespace twofold {
namespace {

/// Fields one after the other, in either encoding.
class FieldReader {
 public:
  FieldReader(std::span<const std::uint8_t> message, MessageEncoding encoding)
      : in_(message), cdr_(encoding == MessageEncoding::kCdr) {
    if (encoding == MessageEncoding::kOther) throw MalformedBytes("a message of unknown encoding");
    if (!cdr_) return;
    // OMG DDSI-RTPS 10.2: two bytes for the kind, 0 or 1: big-endian or little-endian CDR; two bytes of
    // options.
    const auto kind = in_.take(4);
    if (kind[0] != 0 || kind[1] > 1) throw MalformedBytes("a message that is no plain CDR");
    big_endian_ = kind[1] == 0;
    in_ = ByteReader(in_.rest());
  }

  template <class T>
  T number() {
    if (cdr_) (void)in_.take((sizeof(T) - in_.at() % sizeof(T)) % sizeof(T));
    if (!big_endian_) return in_.number<T>();
    std::array<std::uint8_t, sizeof(T)> bytes;
    for (std::uint8_t& byte : bytes) byte = in_.number<std::uint8_t>();
    std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
  }
  std::string text() {
    const auto bytes = block();
    std::string text(bytes.begin(), bytes.end());
    if (cdr_ && !text.empty() && text.back() == '\0') text.pop_back();
    return text;
  }
  std::span<const std::uint8_t> block() { return in_.take(number<std::uint32_t>()); }
  std::vector<double> doubles() {
    const auto count = number<std::uint32_t>();
    if (count > in_.remaining() / sizeof(double)) throw MalformedBytes("ends in the middle");
    std::vector<double> values(count);
    for (double& value : values) value = number<double>();
    return values;
  }
  template <std::size_t N>
  void doubles(std::array<double, N>& values) {
    for (double& value : values) value = number<double>();
  }
  /// std_msgs/Header. @return the stamp [ns]
  std::int64_t header() {
    if (!cdr_) (void)number<std::uint32_t>();  // ROS 1 counts messages
    const std::int64_t seconds =
        cdr_ ? number<std::int32_t>() : static_cast<std::int64_t>(number<std::uint32_t>());
    const std::int64_t ns = number<std::uint32_t>();
    (void)text();  // frame_id
    return seconds * 1'000'000'000 + ns;
  }

 private:
  ByteReader in_;
  bool cdr_, big_endian_ = false;
};

}  // namespace

ImageMessage parse_image(std::span<const std::uint8_t> message, MessageEncoding encoding) {
  FieldReader in(message, encoding);
  ImageMessage image;
  image.t_ns = in.header();
  image.height = in.number<std::uint32_t>();
  image.width = in.number<std::uint32_t>();
  image.encoding = in.text();
  image.big_endian = in.number<std::uint8_t>() != 0;
  image.step = in.number<std::uint32_t>();
  image.pixels = in.block();
  if (std::uint64_t{image.step} * image.height > image.pixels.size())
    throw MalformedBytes("an image with fewer pixels than its size says");
  return image;
}

CompressedImageMessage parse_compressed_image(std::span<const std::uint8_t> message,
                                              MessageEncoding encoding) {
  FieldReader in(message, encoding);
  CompressedImageMessage image;
  image.t_ns = in.header();
  image.format = in.text();
  image.file = in.block();
  return image;
}

CameraInfoMessage parse_camera_info(std::span<const std::uint8_t> message, MessageEncoding encoding) {
  FieldReader in(message, encoding);
  CameraInfoMessage info;
  (void)in.header();
  info.height = in.number<std::uint32_t>();
  info.width = in.number<std::uint32_t>();
  info.distortion_model = in.text();
  info.D = in.doubles();
  in.doubles(info.K);
  in.doubles(info.R);
  in.doubles(info.P);
  return info;
}

}  // namespace twofold
