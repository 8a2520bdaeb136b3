#include "io/sources/bag_survey.hpp"

#include <algorithm>
#include <bit>
#include <optional>
#include <span>

#include "base/bytes.hpp"
#include "base/median.hpp"
#include "io/bags/ros_images.hpp"
#include "io/files/damaged_images.hpp"
#include "io/files/grey_levels.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

constexpr std::uint32_t kTimes = 30;  // left images from which the interval is known
constexpr std::uint32_t kWide = 300;  // left images among which some are looked at for their bits

class Surveyor {
 public:
  Surveyor(BagReader& reader, const BagCameras& cameras, const std::filesystem::path& file)
      : reader_(reader), cameras_(cameras), file_(file) {}

  BagSurvey survey() {
    BagMessage message;
    while (!done() && next(message)) take(message);
    damaged_.expect_any_frame();
    if (survey_.first.empty()) throw IoError(file_, "holds no image of '" + cameras_.left.images.name + "'");
    if (bits_) survey_.grey_bits = camera_bits(*bits_);
    for (const auto* times : {&left_times_, &other_times_}) {
      const std::int64_t interval = median_interval(*times);
      if (interval > 0 && (survey_.interval_ns == 0 || interval < survey_.interval_ns))
        survey_.interval_ns = interval;
    }
    return survey_;
  }

 private:
  using Times = std::vector<std::int64_t>;

  [[nodiscard]] bool done() const {
    return !survey_.first.empty() && left_times_.size() >= (bits_ ? kWide : kTimes);
  }

  /// Where the bag is damaged behind the first image is said when it is read that far.
  bool next(BagMessage& message) {
    try {
      return reader_.next(message);
    } catch (const IoError&) {
      if (survey_.first.empty()) throw;
      return false;
    }
  }

  void take(const BagMessage& message) {
    const bool left = cameras_.left.images.encodings.contains(message.topic);
    const BagCamera& camera = left ? cameras_.left : cameras_.right ? *cameras_.right : *cameras_.depth;
    const bool grey = left || cameras_.right;
    Times& times = left ? left_times_ : other_times_;
    try {
      const MessageEncoding encoding = camera.images.encodings.at(message.topic);
      if (camera.compressed()) {
        take(parse_compressed_image(message.data, encoding), left, grey, times);
      } else {
        take(parse_image(message.data, encoding), left, grey, times);
      }
    } catch (const MalformedBytes& error) {
      if (left && survey_.first.empty()) damaged_.leave_out(IoError(file_, error.what()));
    }
  }

  template <class Message>
  void take(const Message& message, bool left, bool grey, Times& times) {
    const std::size_t number = times.size();
    times.push_back(message.t_ns);
    const bool first = left && survey_.first.empty();
    // 0, 1, 2, 4, 8, ..: most of a short recording, and some of a long one.
    const bool look = number == 0 || (bits_ && std::has_single_bit(number));
    if (!grey || !(first || look)) return;
    const cv::Mat image = grey_image(message);
    if (const auto bits = wide_bits(image)) bits_ = std::max(bits_.value_or(0), *bits);
    if (!first) return;
    survey_.first = image;
    damaged_.frame_was_read();
  }

  static std::int64_t median_interval(const Times& times) {
    constexpr std::size_t kFewest = 4;
    if (times.size() <= kFewest) return 0;
    std::vector<std::int64_t> intervals;
    for (std::size_t i = 1; i < times.size(); ++i) intervals.push_back(times[i] - times[i - 1]);
    return median(std::span(intervals));
  }

  BagReader& reader_;
  const BagCameras& cameras_;
  const std::filesystem::path& file_;
  BagSurvey survey_;
  std::optional<int> bits_;  // of the brightest pixel, if images are of 16
  Times left_times_, other_times_;
  DamagedImages damaged_;
};

}  // namespace

std::set<std::uint32_t> ids_of(const MergedTopic& topic) {
  std::set<std::uint32_t> ids;
  for (const auto& [id, encoding] : topic.encodings) ids.insert(id);
  return ids;
}

std::set<std::uint32_t> image_ids(const BagCameras& cameras) {
  std::set<std::uint32_t> ids = ids_of(cameras.left.images);
  if (cameras.right) ids.merge(ids_of(cameras.right->images));
  if (cameras.depth) ids.merge(ids_of(cameras.depth->images));
  return ids;
}

BagSurvey survey_bag(BagReader& reader, const BagCameras& cameras, const std::filesystem::path& file) {
  reader.select(image_ids(cameras));
  return Surveyor(reader, cameras, file).survey();
}

}  // namespace twofold
