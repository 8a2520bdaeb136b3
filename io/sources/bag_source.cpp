#include "io/sources/bag_source.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/bytes.hpp"
#include "evaluation/tum_line.hpp"
#include "io/bags/ros_images.hpp"
#include "io/files/calibration_file.hpp"
#include "io/files/grey_levels.hpp"
#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/bag_survey.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

constexpr double kStereoGap = 0.002, kDepthGap = 0.016;  // [s]
// Images of one camera that wait for the other's (which may have to wait for their order): beyond that its
// topic has ended or is another recording's.
constexpr std::size_t kMostWaiting = 64 + BagImageOrder::kConfirmed;

BagImage decode(const BagCamera& camera, std::optional<double> depth_unit, const BagMessage& message) {
  const MessageEncoding encoding = camera.images.encodings.at(message.topic);
  if (camera.compressed()) {
    const CompressedImageMessage image = parse_compressed_image(message.data, encoding);
    return {image.t_ns, depth_unit ? depth_image(image) : grey_image(image), message.place};
  }
  const ImageMessage image = parse_image(message.data, encoding);
  return {image.t_ns, depth_unit ? depth_image(image, *depth_unit) : grey_image(image), message.place};
}

/// Of a message that was read again: the file may have changed meanwhile.
cv::Mat decode_colour(const BagCamera& camera, const BagMessage& message) {
  const auto encoding = camera.images.encodings.find(message.topic);
  if (encoding == camera.images.encodings.end())
    throw MalformedBytes("a message of another topic stands where an image was");
  return camera.compressed() ? colour_image(parse_compressed_image(message.data, encoding->second))
                             : colour_image(parse_image(message.data, encoding->second));
}

/// At high rates the image before or after lies within the usual gap, too.
double usual_gap(const BagCameras& cameras, const BagSurvey& survey) {
  const double usual = cameras.depth ? kDepthGap : kStereoGap;
  return survey.interval_ns == 0 ? usual : std::min(usual, 0.5e-9 * static_cast<double>(survey.interval_ns));
}

}  // namespace

template <class Function>
auto BagSource::named(Function function) const {
  try {
    return function();
  } catch (const MalformedBytes& error) {
    throw IoError(file_, error.what());
  }
}

BagSource::BagSource(std::unique_ptr<BagReader> reader, const std::filesystem::path& file,
                     const std::optional<std::filesystem::path>& calibration, SourceParameters& parameters)
    : file_(file), reader_(std::move(reader)) {
  const WantedTopics wanted{parameters.take_text("left"), parameters.take_text("right"),
                            parameters.take_text("depth")};
  cameras_ = named([&] { return choose_cameras(reader_->topics(), wanted); });
  Calibration used = find_calibration(calibration, parameters);
  const BagSurvey survey = survey_bag(*reader_, cameras_, file_);
  const std::int64_t max_gap_ns = parameters.take_max_gap_ns(usual_gap(cameras_, survey));
  if (cameras_.kind() != SensorKind::kMono) pairer_.emplace(max_gap_ns);
  grey_bits_ = survey.grey_bits;
  if (grey_bits_ < 16) notes_.push_back(grey_levels_note(file_.string(), grey_bits_));
  const std::filesystem::path calibration_file = calibration.value_or(file_);
  set_missing_size(calibration_file, survey.first.cols, survey.first.rows, &used);
  expect_valid(calibration_file, used);
  expect_size(file_, survey.first, used.left.pinhole, size_of_calibration(calibration_file));
  try {
    rectifier_.emplace(used);
  } catch (const std::runtime_error& error) {
    throw IoError(calibration_file, error.what());
  }
  if (const std::string black = rectifier_->black_note(); !black.empty())
    notes_.push_back(calibration_file.string() + ": " + black);
  raw_left_ = used.left.pinhole;
  rig_ = rectifier_->rig();
  R_rectified_raw_ = rectifier_->R_rectified_left();
  if (cameras_.depth) depth_unit_ = used.depth_unit;
  left_order_ = other_order_ = BagImageOrder(survey.interval_ns);
  reader_->select(image_ids(cameras_));
}

Calibration BagSource::find_calibration(const std::optional<std::filesystem::path>& calibration,
                                        SourceParameters& parameters) {
  std::optional<Calibration> base;
  if (calibration) {
    base = read_calibration(*calibration);
    if (cameras_.right && base->kind != SensorKind::kStereo && !parameters.left_only())
      throw IoError(*calibration, "is not for a stereo camera, but the bag has one");
  } else {
    base = recorded_calibration();
  }
  // The user's own numbers stand against those of the bag.
  if (!(base && base->depth_apart) && !parameters.has_intrinsics() && !parameters.left_only())
    expect_registered_depth();
  const bool known = base.has_value();
  Calibration used = base.value_or(Calibration());
  if (cameras_.depth && !used.depth_unit_stated) used.depth_unit = kRosDepthUnit;
  return with_parameters(std::move(used), known, cameras_.kind(), parameters);
}

void BagSource::expect_registered_depth() {
  if (!cameras_.depth) return;
  const auto left = first_info(cameras_.left), depth = first_info(*cameras_.depth);
  if (!left || !depth) return;
  const std::string mismatch = depth_mismatch(*left, *depth);
  if (mismatch.empty()) return;
  throw IoError(file_,
                fmt::format("the depth images of '{}' are of another camera by their camera_info ({}): "
                            "take a topic of depth that is registered to the colour camera (depth=/TOPIC; "
                            "its name has 'registered' or 'aligned' mostly), or give --calib with the depth "
                            "camera; where camera_info is wrong, fx, fy, cx, cy",
                            cameras_.depth->images.name, mismatch));
}

std::optional<Calibration> BagSource::recorded_calibration() {
  const auto left = first_info(cameras_.left);
  if (!left) return std::nullopt;
  std::optional<CameraInfoMessage> right;
  if (cameras_.right && !(right = first_info(*cameras_.right))) return std::nullopt;
  return named([&] { return calibration_of(cameras_, *left, right); });
}

std::optional<CameraInfoMessage> BagSource::first_info(const BagCamera& camera) {
  if (!camera.info) return std::nullopt;
  reader_->select(ids_of(*camera.info));
  BagMessage message;
  if (!reader_->next(message)) return std::nullopt;
  return named([&] { return parse_camera_info(message.data, camera.info->encodings.at(message.topic)); });
}

bool BagSource::take_message() {
  BagMessage message;
  if (!reader_->next(message)) return false;
  const bool left = cameras_.left.images.encodings.contains(message.topic);
  const BagCamera& camera = left ? cameras_.left : cameras_.right ? *cameras_.right : *cameras_.depth;
  BagImage image;
  try {
    image = named([&] { return decode(camera, left ? std::nullopt : depth_unit_, message); });
  } catch (const IoError& error) {
    damaged_.leave_out(error);
    return true;
  }
  if (left || !cameras_.depth) look_at_grey_levels(image);
  Queue& queue = left ? left_ : other_;
  leave_out(camera, (left ? left_order_ : other_order_).add(std::move(image), queue));
  for (; queue.size() > kMostWaiting; queue.pop_front()) ++alone_;
  return true;
}

void BagSource::finish_order() {
  leave_out(cameras_.left, left_order_.finish(left_));
  if (cameras_.right) leave_out(*cameras_.right, other_order_.finish(other_));
  if (cameras_.depth) leave_out(*cameras_.depth, other_order_.finish(other_));
}

void BagSource::leave_out(const BagCamera& camera, const std::vector<std::string>& reasons) {
  for (const std::string& reason : reasons)
    unordered_.leave_out(IoError(file_, fmt::format("an image of '{}' {}", camera.images.name, reason)));
}

void BagSource::look_at_grey_levels(const BagImage& image) {
  if (grey_bits_ >= 16) return;
  const int bits = camera_bits(wide_bits(image.image).value_or(0));
  if (bits <= grey_bits_) return;
  brighter_.push_back(
      fmt::format("{}: images of 16 bits use {} bits, not {}, from {} s on: grey levels are taken "
                  "from 0 to {}",
                  file_.string(), bits, grey_bits_, seconds_text(image.t_ns), (1 << bits) - 1));
  grey_bits_ = bits;
}

bool BagSource::next_may_be_nearer() const {
  const std::int64_t t_left = left_.front().t_ns, t_other = other_.front().t_ns;
  const bool left_first = t_left < t_other;
  return !ended_ && pairer_->depends_on_next(t_left, t_other) && (left_first ? left_ : other_).size() == 1 &&
         (left_first ? other_ : left_).size() < kMostWaiting;
}

bool BagSource::take_pair(Frame& raw) {
  while (!left_.empty() && !other_.empty()) {
    if (next_may_be_nearer()) return false;
    const Queue& earlier = left_.front().t_ns < other_.front().t_ns ? left_ : other_;
    const auto next = earlier.size() > 1 ? std::optional(earlier[1].t_ns) : std::nullopt;
    const PairingStep step = pairer_->step(left_.front().t_ns, other_.front().t_ns, next);
    if (step == PairingStep::kPair) {
      take_left(raw);
      if (cameras_.depth) raw.depth = std::move(other_.front().image);
      if (cameras_.right) raw.right = eight_bits(other_.front().image, grey_bits_);
      other_.pop_front();
      return true;
    }
    (step == PairingStep::kAdvanceLeft ? left_ : other_).pop_front();
    ++alone_;
  }
  return false;
}

void BagSource::take_left(Frame& raw) {
  raw.index = index_++;
  raw.t_ns = left_.front().t_ns;
  raw.left = eight_bits(left_.front().image, grey_bits_);
  {
    const std::scoped_lock lock(places_mutex_);
    left_places_.push_back(left_.front().place);
  }
  left_.pop_front();
  damaged_.frame_was_read();
  unordered_.frame_was_read();
}

bool BagSource::read(Frame& frame) {
  Frame raw;
  for (;;) {
    if (pairer_ && take_pair(raw)) break;
    if (!pairer_ && !left_.empty()) {
      take_left(raw);
      break;
    }
    if (!ended_) {  // at the end, what waited for more is taken
      ended_ = !take_message();
      if (ended_) finish_order();
      continue;
    }
    damaged_.expect_any_frame();
    if (index_ == 0) throw IoError(file_, "no two images belong together (parameter max_gap)");
    return false;
  }
  if (rig_.kind == SensorKind::kMono) raw.right = cv::Mat();  // of a camera that is not known
  if (const auto reason = rectifier_->mismatch_reason(raw); !reason.empty()) throw IoError(file_, reason);
  frame = Frame();  // its old images may still be held elsewhere: never write into them
  rectifier_->rectify(raw, frame);
  return true;
}

std::optional<MessagePlace> BagSource::left_place(std::int64_t index) const {
  const std::scoped_lock lock(places_mutex_);
  if (index < 0 || index >= static_cast<std::int64_t>(left_places_.size())) return std::nullopt;
  return left_places_[static_cast<std::size_t>(index)];
}

cv::Mat BagSource::colour_image(std::int64_t index) const {
  const auto place = left_place(index);
  if (!place) return {};
  const std::scoped_lock lock(again_mutex_);
  const cv::Mat raw =
      named([&] { return decode_colour(cameras_.left, reader_->read_again(*place, chunk_)); });
  if (raw.empty()) return raw;
  expect_size(file_, raw, raw_left_, size_of_calibration(file_));
  return rectifier_->rectified_left(raw);
}

SourceReport BagSource::report() const {
  SourceReport report;
  report.lost = alone_ + damaged_.count() + unordered_.count();
  report.notes = notes_;
  for (const auto* lines : {&damaged_.lines(), &unordered_.lines(), &brighter_})
    report.faults.insert(report.faults.end(), lines->begin(), lines->end());
  if (damaged_.count() > 0)
    report.summary.push_back(
        fmt::format("{}: {} damaged images were left out", file_.string(), damaged_.count()));
  if (unordered_.count() > 0)
    report.summary.push_back(fmt::format("{}: {} images whose times are out of order were left out",
                                         file_.string(), unordered_.count()));
  if (alone_ > 0) report.summary.push_back(fmt::format("{}: {} images were alone", file_.string(), alone_));
  if (const std::string fault = reader_->fault(); !fault.empty()) report.faults.push_back(fault);
  return report;
}

}  // namespace twofold
