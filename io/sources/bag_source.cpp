#include "io/sources/bag_source.hpp"

#include <fmt/format.h>

#include "base/bytes.hpp"
#include "io/bags/ros_images.hpp"
#include "io/files/calibration_file.hpp"
#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

constexpr double kStereoGap = 0.002, kDepthGap = 0.016;  // [s]
// Images of one camera that wait for the other's: beyond that its topic has ended or is another recording's.
constexpr std::size_t kMostWaiting = 64;

std::set<std::uint32_t> ids_of(const MergedTopic& topic) {
  std::set<std::uint32_t> ids;
  for (const auto& [id, encoding] : topic.encodings) ids.insert(id);
  return ids;
}

BagImage decode(const BagCamera& camera, bool depth, const BagMessage& message) {
  const MessageEncoding encoding = camera.images.encodings.at(message.topic);
  if (camera.compressed()) {
    const CompressedImageMessage image = parse_compressed_image(message.data, encoding);
    return {image.t_ns, depth ? depth_image(image) : grey_image(image)};
  }
  const ImageMessage image = parse_image(message.data, encoding);
  return {image.t_ns, depth ? depth_image(image) : grey_image(image)};
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
  const std::int64_t max_gap_ns = parameters.take_max_gap_ns(cameras_.depth ? kDepthGap : kStereoGap);
  if (cameras_.kind() != SensorKind::kMono) pairer_.emplace(max_gap_ns);
  Calibration used = find_calibration(calibration, parameters);
  const cv::Mat first = first_image();
  set_missing_size(first.cols, first.rows, &used);
  const std::filesystem::path calibration_file = calibration.value_or(file_);
  expect_valid(calibration_file, used);
  expect_size(file_, first, used.left.pinhole);
  try {
    rectifier_.emplace(used);
  } catch (const std::runtime_error& error) {
    throw IoError(calibration_file, error.what());
  }
  rig_ = rectifier_->rig();
  R_rectified_raw_ = rectifier_->R_rectified_left();
  select_images();
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
  if (cameras_.depth && base) base->depth_unit = kRosDepthUnit;
  const bool known = base.has_value();
  Calibration used = with_parameters(base.value_or(Calibration()), known, cameras_.kind(), parameters);
  if (cameras_.depth && !known) used.depth_unit = kRosDepthUnit;
  return used;
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

cv::Mat BagSource::first_image() {
  reader_->select(ids_of(cameras_.left.images));
  BagMessage message;
  if (!reader_->next(message)) throw IoError(file_, "holds no image of '" + cameras_.left.images.name + "'");
  return named([&] { return decode(cameras_.left, false, message).image; });
}

void BagSource::select_images() {
  std::set<std::uint32_t> topics = ids_of(cameras_.left.images);
  if (cameras_.right) topics.merge(ids_of(cameras_.right->images));
  if (cameras_.depth) topics.merge(ids_of(cameras_.depth->images));
  reader_->select(std::move(topics));
}

bool BagSource::take_message() {
  BagMessage message;
  if (!reader_->next(message)) return false;
  const bool left = cameras_.left.images.encodings.contains(message.topic);
  const BagCamera& camera = left ? cameras_.left : cameras_.right ? *cameras_.right : *cameras_.depth;
  Queue& queue = left ? left_ : other_;
  try {
    queue.push_back(named([&] { return decode(camera, !left && cameras_.depth, message); }));
  } catch (const IoError& error) {
    damaged_.leave_out(error);
    return true;
  }
  if (queue.size() > kMostWaiting) {
    queue.pop_front();
    ++alone_;
  }
  return true;
}

bool BagSource::take_pair(Frame& raw) {
  while (!left_.empty() && !other_.empty()) {
    const PairingStep step = pairer_->step(left_.front().t_ns, other_.front().t_ns);
    if (step == PairingStep::kPair) {
      take_left(raw);
      (cameras_.depth ? raw.depth : raw.right) = std::move(other_.front().image);
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
  raw.left = std::move(left_.front().image);
  left_.pop_front();
  damaged_.frame_was_read();
}

bool BagSource::read(Frame& frame) {
  Frame raw;
  for (;;) {
    if (pairer_ && take_pair(raw)) break;
    if (!pairer_ && !left_.empty()) {
      take_left(raw);
      break;
    }
    if (take_message()) continue;
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

SourceReport BagSource::report() const {
  SourceReport report;
  report.lost = alone_ + damaged_.count();
  report.faults = damaged_.lines();
  if (damaged_.count() > 0)
    report.summary.push_back(
        fmt::format("{}: {} damaged images were left out", file_.string(), damaged_.count()));
  if (alone_ > 0) report.summary.push_back(fmt::format("{}: {} images were alone", file_.string(), alone_));
  if (const std::string fault = reader_->fault(); !fault.empty()) report.faults.push_back(fault);
  return report;
}

}  // namespace twofold
