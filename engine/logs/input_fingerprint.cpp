#include "engine/logs/input_fingerprint.hpp"

#include <bit>
#include <cstddef>
#include <opencv2/core/mat.hpp>

namespace twofold {
namespace {

/// FNV-1a of 64 bits.
class Hash {
 public:
  void add(const std::uint8_t* bytes, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3U;
  }
  void add(std::uint64_t number) {
    for (unsigned shift = 0; shift < 64; shift += 8)
      value_ = (value_ ^ ((number >> shift) & 0xffU)) * 0x100000001b3U;
  }
  void add(double number) { add(std::bit_cast<std::uint64_t>(number)); }
  /// Row by row: those of a cut-out do not follow each other.
  void add(const cv::Mat& image) {
    add(static_cast<std::uint64_t>(image.rows));
    add(static_cast<std::uint64_t>(image.cols));
    for (int row = 0; row < image.rows; ++row)
      add(image.ptr(row), static_cast<std::size_t>(image.cols) * image.elemSize());
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

std::uint64_t hash_of(const Rig& rig) {
  Hash hash;
  hash.add(static_cast<std::uint64_t>(rig.kind));
  hash.add(static_cast<std::uint64_t>(rig.camera.width));
  hash.add(static_cast<std::uint64_t>(rig.camera.height));
  for (const double number : {rig.camera.fx, rig.camera.fy, rig.camera.cx, rig.camera.cy}) hash.add(number);
  if (rig.kind != SensorKind::kMono) hash.add(rig.baseline);
  if (rig.kind == SensorKind::kRgbd)  // of stereo they say what surfaces are made of
    for (const double number : {rig.depth_unit, rig.depth_min, rig.depth_max}) hash.add(number);
  hash.add(rig.readout.value_or(-1));
  return hash.value();
}

}  // namespace

InputFingerprint fingerprint_of(const Rig& rig, const Frame& first) {
  Hash frame;
  frame.add(static_cast<std::uint64_t>(first.t_ns));
  for (const cv::Mat* image : {&first.left, &first.right, &first.depth}) frame.add(*image);
  return {hash_of(rig), frame.value()};
}

std::string mismatch(const InputFingerprint& expected, const InputFingerprint& given) {
  if (given.rig != expected.rig) return "the schedule belongs to another rig than that of these frames";
  if (given.first_frame != expected.first_frame)
    return "the schedule belongs to another recording: its first frame was another one";
  return "";
}

}  // namespace twofold
