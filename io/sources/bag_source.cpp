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

BagImage decode(const BagCamera& camera, std::optional<double> depth_unit, const BagMessage& message) {
  const MessageEncoding encoding = camera.images.encodings.at(message.topic);
  if (camera.compressed()) {
    const CompressedImageMessage image = parse_compressed_image(message.data, encoding);
    return {image.t_ns, depth_unit ? depth_image(image) : grey_image(image)};
  }
  const ImageMessage image = parse_image(message.data, encoding);
  return {image.t_ns, depth_unit ? depth_image(image, *depth_unit) : grey_image(image)};
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
  if (cameras_.depth) depth_unit_ = used.depth_unit;
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

cv::Mat BagSource::first_image() {
  reader_->select(ids_of(cameras_.left.images));
  BagMessage message;
  if (!reader_->next(message)) throw IoError(file_, "holds no image of '" + cameras_.left.images.name + "'");
  return named([&] { return decode(cameras_.left, std::nullopt, message).image; });
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
    queue.push_back(named([&] { return decode(camera, left ? std::nullopt : depth_unit_, message); }));
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
