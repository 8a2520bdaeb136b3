#include "io/sources/recorder.hpp"

#include <opencv2/imgcodecs.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/option_check.hpp"
#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

std::string distortion_lines(const Distortion& distortion) {
  if (distortion.model == DistortionModel::kNone) return {};
  const auto& k = distortion.coefficients;
  return fmt::format("distortion_model: {}\ndistortion_coefficients: [{}]\n",
                     distortion_name(distortion.model),
                     fmt::join(k.begin(), k.begin() + distortion.coefficient_count(), ", "));
}

/// fmt writes the shortest text that reads back as the same number.
std::string sensor_yaml(const CameraModel& camera, const SE3& T_b_c, const Calibration& calibration) {
  const PinholeCamera& p = camera.pinhole;
  const Eigen::Matrix4d T = T_b_c.matrix();
  std::vector<double> rows;
  rows.reserve(16);
  for (int i = 0; i < 16; ++i) rows.push_back(T(i / 4, i % 4));
  std::string text = "sensor_type: camera\n";
  text += fmt::format("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", fmt::join(rows, ", "));
  if (calibration.fps > 0) text += fmt::format("rate_hz: {}\n", calibration.fps);
  if (calibration.readout) text += fmt::format("readout: {}\n", *calibration.readout);
  text += fmt::format("resolution: [{}, {}]\n", p.width, p.height);
  if (camera.distortion.model == DistortionModel::kDoubleSphere) {
    const auto& k = camera.distortion.coefficients;
    return text + fmt::format("camera_model: ds\nintrinsics: [{}, {}, {}, {}, {}, {}]\n", k[0], k[1], p.fx,
                              p.fy, p.cx, p.cy);
  }
  text += fmt::format("camera_model: pinhole\nintrinsics: [{}, {}, {}, {}]\n", p.fx, p.fy, p.cx, p.cy);
  return text + distortion_lines(camera.distortion);
}

}  // namespace

Calibration calibration_of(const Rig& rig) {
  Calibration calibration;
  calibration.kind = rig.kind;
  calibration.left.pinhole = rig.camera;
  calibration.right = calibration.left;
  calibration.T_right_left = SE3(SO3(), Vector3(-rig.baseline, 0, 0));
  calibration.readout = rig.readout;
  return calibration;
}

std::string RecorderOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("queue_frames", static_cast<double>(queue_frames), 1)
      .within("png_compression", png_compression, 0, 9)
      .reason();
}

Recorder::Recorder(const fs::path& folder, SensorKind kind, const std::optional<Calibration>& calibration,
                   const RecorderOptions& options)
    : mav_(folder / "mav0"), cameras_(kind == SensorKind::kStereo ? 2 : 1), options_(options) {
  if (kind == SensorKind::kRgbd) throw IoError(folder, "depth cannot be recorded in this layout");
  if (const std::string reason = options.invalid_reason(); !reason.empty()) throw IoError(folder, reason);
  if (fs::exists(mav_)) throw IoError(folder, "holds a recording already; name another folder");
  for (int c = 0; c < cameras_; ++c) {
    const fs::path camera = mav_ / fmt::format("cam{}", c);
    prepare_output_folder(camera / "data");
    if (calibration) {
      // The body frame is the left camera's.
      const SE3 T_b_c = c == 0 ? SE3() : calibration->T_right_left.inverse();
      write_file(camera / "sensor.yaml",
                 sensor_yaml(c == 0 ? calibration->left : calibration->right, T_b_c, *calibration));
    }
    lists_[c].rdbuf()->pubsetbuf(nullptr, 0);  // or a line that failed would be tried again at the end
    lists_[c].open(camera / "data.csv", std::ios::binary);
    lists_[c] << "#timestamp [ns],filename\n" << std::flush;
    if (!lists_[c]) throw IoError(camera / "data.csv", "cannot be written");
  }
  thread_ = std::thread([this] { write_loop(); });
}

Recorder::~Recorder() {
  [[maybe_unused]] const std::string problem = finish();
}

bool Recorder::offer(const Frame& frame, bool wait) {
  std::unique_lock lock(mutex_);
  const auto has_room = [this] { return queue_.size() < options_.queue_frames || !error_.empty(); };
  if (wait) changed_.wait(lock, has_room);
  if (ending_ || !error_.empty() || queue_.size() >= options_.queue_frames) {
    ++counts_.refused;
    return false;
  }
  queue_.push_back(frame);
  changed_.notify_all();
  return true;
}

std::string Recorder::finish() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
  const std::lock_guard lock(mutex_);
  return error_;
}

Recorder::Counts Recorder::counts() const {
  const std::lock_guard lock(mutex_);
  Counts counts = counts_;
  counts.queued = queue_.size();
  return counts;
}

bool Recorder::failed() const {
  const std::lock_guard lock(mutex_);
  return !error_.empty();
}

void Recorder::write_loop() {
  for (;;) {
    Frame frame;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || !queue_.empty(); });
      if (queue_.empty()) return;
      frame = queue_.front();  // stays queued, and counted as such, until it is written
    }
    std::string problem;
    try {
      write_frame(frame);
    } catch (const std::exception& e) {
      problem = e.what();
    }
    const std::lock_guard lock(mutex_);
    if (problem.empty()) {
      queue_.pop_front();
      ++counts_.written;
    } else {
      error_ = problem;
      counts_.refused += queue_.size();
      queue_.clear();
    }
    changed_.notify_all();
    if (!problem.empty()) return;
  }
}

std::uint64_t Recorder::write_image(int camera, const std::string& name, const cv::Mat& image) const {
  const fs::path folder = mav_ / fmt::format("cam{}", camera) / "data";
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, options_.png_compression})) {
    throw IoError(folder / name, "cannot be encoded");
  }
  const fs::path part = folder / (name + ".part");
  try {
    write_file(part, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    fs::rename(part, folder / name);
  } catch (...) {
    std::error_code ignored;
    fs::remove(part, ignored);
    throw;
  }
  return bytes.size();
}

void Recorder::write_frame(const Frame& frame) {
  const std::string name = fmt::format("{}.png", frame.t_ns);
  std::uint64_t bytes = write_image(0, name, frame.left);
  if (cameras_ == 2) bytes += write_image(1, name, frame.right);
  for (int c = 0; c < cameras_; ++c) {
    const auto end = lists_[c].tellp();
    lists_[c] << fmt::format("{},{}\n", frame.t_ns, name) << std::flush;
    if (lists_[c]) continue;
    // Half a line, or a line in one list only, would make the whole recording unreadable: taken back.
    for (int k = 0; k <= c; ++k) {
      const fs::path list = mav_ / fmt::format("cam{}", k) / "data.csv";
      std::error_code ignored;
      if (k == c && end >= 0) fs::resize_file(list, static_cast<std::uintmax_t>(end), ignored);
      if (k < c)
        fs::resize_file(list, fs::file_size(list, ignored) - fmt::format("{},{}\n", frame.t_ns, name).size(),
                        ignored);
    }
    throw WriteError(mav_ / fmt::format("cam{}", c) / "data.csv", "cannot be written (is the disk full?)");
  }
  const std::lock_guard lock(mutex_);
  counts_.bytes += bytes;
}

}  // namespace twofold
