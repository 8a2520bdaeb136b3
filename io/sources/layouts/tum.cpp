#include "io/files/image_pairs.hpp"
#include "io/files/io_error.hpp"
#include "io/files/openloris_files.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/layouts/icl_nuim.hpp"
#include "io/sources/layouts/published_cameras.hpp"
#include "io/sources/layouts/tum_calibration.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxDifferenceNs = 20'000'000;  // as the benchmark's own association script

/// How a dataset names its lists of images, and what its own files do not say.
struct ImageLists {
  const char* colour;
  const char* depth;
  double depth_unit;  ///< of a depth image [m]
  bool of_base;       ///< the truth has the poses of the robot's base
};

/// TUM's unless only OpenLORIS' are there.
const ImageLists& lists_in(const fs::path& folder) {
  static const ImageLists kTum{"rgb.txt", "depth.txt", 1.0 / 5000, false};
  static const ImageLists kOpenLoris{"color.txt", "aligned_depth.txt", 0.001, true};
  const bool tum = fs::exists(folder / "associations.txt") || fs::exists(folder / kTum.colour);
  return !tum && fs::exists(folder / kOpenLoris.colour) ? kOpenLoris : kTum;
}

/// Lines "time file".
std::vector<StampedFile> read_list(const fs::path& folder, const char* name) {
  const fs::path file = folder / name;
  std::vector<StampedFile> entries;
  std::int64_t previous = -1;
  for (const TextLine& line : read_table_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields.size() != 2) throw IoError(file, line.number, "is not 'time file'");
    entries.push_back({seconds_field(file, line.number, fields[0]), folder / fields[1]});
    expect_increasing(file, line.number, entries.back().t_ns, &previous);
  }
  return entries;
}

/// Lines "time rgb-file time depth-file".
std::vector<RecordedFrame> read_associations(const fs::path& folder) {
  const fs::path file = folder / "associations.txt";
  std::vector<RecordedFrame> frames;
  std::int64_t previous = -1;
  for (const TextLine& line : read_table_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields.size() != 4) throw IoError(file, line.number, "is not 'time rgb-file time depth-file'");
    // Some tools write depth first.
    const bool depth_first = fields[1].find("depth") != std::string_view::npos;
    const std::size_t rgb = depth_first ? 2 : 0;
    const std::size_t depth = depth_first ? 0 : 2;
    (void)seconds_field(file, line.number, fields[depth]);
    RecordedFrame frame{seconds_field(file, line.number, fields[rgb]),
                        folder / fields[rgb + 1],
                        {},
                        folder / fields[depth + 1]};
    expect_increasing(file, line.number, frame.t_ns, &previous);
    frames.push_back(std::move(frame));
  }
  return frames;
}

/// Pairs of a colour and a depth image, closest in time first; each image is used once; colour images without
/// a depth image are left out.
std::vector<RecordedFrame> associate(const std::vector<StampedFile>& rgb,
                                     const std::vector<StampedFile>& depth) {
  std::vector<RecordedFrame> frames;
  for (const auto& [c, d] : pairs_by_time(rgb, depth, kMaxDifferenceNs))
    frames.push_back({rgb[c].t_ns, rgb[c].file, {}, depth[d].file});
  return frames;
}

/// Those listed in two files: TUM's rgb.txt and depth.txt, or OpenLORIS' color.txt and aligned_depth.txt,
/// whose depth.txt is of images that are not registered to the colour camera's.
void take_listed_frames(const ImageLists& lists, bool left_only, Recording* recording) {
  const fs::path& folder = recording->folder;
  const auto colour = read_list(folder, lists.colour);
  if (left_only) {
    for (const StampedFile& image : colour) recording->frames.push_back({image.t_ns, image.file, {}, {}});
    return;
  }
  if (!fs::exists(folder / lists.depth))
    throw IoError(folder / lists.depth, "no such file (--camera mono runs the colour camera alone)");
  recording->frames = associate(colour, read_list(folder, lists.depth));
  if (recording->frames.empty()) throw IoError(folder, "no colour image has a depth image within 20 ms");
}

/// The truth in the folder, if there is any, as poses of the camera whose images are played.
void take_listed_truth(const ImageLists& lists, Recording* recording) {
  const fs::path& folder = recording->folder;
  if (const fs::path rendered = icl_nuim_truth_file(folder); !rendered.empty()) {
    take_truth([&] { return read_icl_nuim_trajectory(rendered); }, recording);
  } else if (const fs::path truth = folder / "groundtruth.txt"; fs::exists(truth)) {
    const auto read = [&] {
      Trajectory poses = read_tum_trajectory(truth);
      if (!lists.of_base) return poses;
      const SE3 T_base_camera = read_openloris_camera_in_base(folder / "trans_matrix.yaml");
      for (TimedPose& pose : poses) pose.T_w_c = pose.T_w_c * T_base_camera;
      return poses;
    };
    take_truth(read, recording);
  }
}

/// ICL-NUIM numbers its frames instead of giving times.
void take_times_of_numbers(Recording* recording) {
  for (RecordedFrame& frame : recording->frames) frame.t_ns /= kIclNuimFps;
}

bool is_icl_nuim(const fs::path& folder) {
  return dataset_by_name(folder) == PublicDataset::kIclNuim || !icl_nuim_truth_file(folder).empty();
}

}  // namespace

/// TUM RGB-D benchmark: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats. Also ETH3D SLAM, Bonn
/// RGB-D Dynamic, ICL-NUIM and OpenLORIS.
Recording read_tum_recording(const fs::path& folder, const std::optional<fs::path>& calibration,
                             SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  const bool associated = fs::exists(folder / "associations.txt");
  const ImageLists& lists = lists_in(folder);
  if (associated) {
    recording.frames = read_associations(folder);
  } else {
    take_listed_frames(lists, parameters.left_only(), &recording);
  }
  if (associated && is_icl_nuim(folder)) take_times_of_numbers(&recording);
  note_long_intervals(folder / (associated ? "associations.txt" : lists.colour), recording);
  take_tum_calibration(calibration, lists.depth_unit, parameters, &recording);
  take_listed_truth(lists, &recording);
  return recording;
}

}  // namespace twofold
