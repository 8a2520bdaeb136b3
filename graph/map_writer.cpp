#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <mutex>
#include <utility>

#include "base/checksum.hpp"
#include "graph/map_file.hpp"
#include "graph/map_format.hpp"
#include "graph/map_place.hpp"

namespace twofold {
namespace {

using namespace map_format;
namespace fs = std::filesystem;

/// What symbolic links lead to, whether it is there or not: that is replaced, and they stay.
fs::path followed(fs::path file) {
  constexpr int kMostLinks = 40;  // as the kernel has it
  std::error_code error;
  for (int links = 0; links < kMostLinks && fs::is_symlink(file, error); ++links)
    file = file.parent_path() / fs::read_symlink(file, error);
  return file;
}

bool begins_as_map(const fs::path& file) {
  std::array<char, kMagic.size()> begin{};
  std::ifstream in(file, std::ios::binary);
  in.read(begin.data(), begin.size());
  return in.good() && begin == kMagic;
}

/// A file that appears under its name only when it is complete, with the mode of the one that it replaces.
///
/// Threads take turns. Programs that write the same map have a temporary file each: whoever writes one holds
/// its lock until it has the map's name. One that a killed program left has no lock any more, and is used
/// again.
class ReplacedFile {
 public:
  explicit ReplacedFile(const fs::path& file) : file_(followed(file)) {
    for (int n = 0; fd_ < 0; ++n) {
      temporary_ = file_.string() + (n == 0 ? ".tmp" : ".tmp" + std::to_string(n));
      fd_ = open_temporary();
    }
    struct stat before {};
    if (::stat(file_.c_str(), &before) == 0) (void)::fchmod(fd_, before.st_mode & 07777);
  }
  ReplacedFile(const ReplacedFile&) = delete;
  ReplacedFile& operator=(const ReplacedFile&) = delete;
  ~ReplacedFile() {
    if (fd_ < 0) return;
    if (!done_) ::unlink(temporary_.c_str());
    ::close(fd_);
  }

  void write(std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(fd_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail("cannot be written");
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
  }

  /// The data must be on the disk before the name points to it, and the name before we say so.
  void commit() {
    if (::fsync(fd_) != 0) fail("cannot be written");
    if (::rename(temporary_.c_str(), file_.c_str()) != 0) fail("cannot be renamed");
    done_ = true;
    ::close(std::exchange(fd_, -1));  // gives up the lock; after the sync nothing is left to fail
    const fs::path folder = file_.has_parent_path() ? file_.parent_path() : fs::path(".");
    const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return;  // the map is there; not every file system lets its folders be opened
    (void)::fsync(fd);
    ::close(fd);
  }

 private:
  /// Opens the temporary file, empty; -1: another program is writing it.
  int open_temporary() const {
    for (int tries = 0; tries < kMostTries; ++tries) {
      const int fd =
          ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0644);
      if (fd < 0) fail("cannot be opened for writing");
      // Not every file system has locks; without, programs must not write one map at once.
      const bool is_locked = ::flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
      // Between open and lock it may have become the map, or gone.
      if (!is_locked && is_temporary(fd) && ::ftruncate(fd, 0) == 0) return fd;
      ::close(fd);
      if (is_locked) return -1;
    }
    throw MapFileError(temporary_.string() + ": is no file, or others replace it all the time");
  }
  [[nodiscard]] bool is_temporary(int fd) const {
    struct stat opened {
    }, named{};
    return ::fstat(fd, &opened) == 0 && ::lstat(temporary_.c_str(), &named) == 0 && S_ISREG(named.st_mode) &&
           opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
  }

  [[noreturn]] void fail(const char* what) const {
    throw MapFileError(temporary_.string() + ": " + what + ": " + std::strerror(errno));
  }

  static constexpr int kMostTries = 1000;  // each is lost to another program's map
  static inline std::mutex one_at_a_time;

  std::unique_lock<std::mutex> turn_{one_at_a_time};
  fs::path file_, temporary_;
  int fd_ = -1;
  bool done_ = false;
};

void write_section(ReplacedFile& file, Section section, std::span<const std::uint8_t> bytes) {
  ByteWriter head;
  head.put(section);
  head.put(std::uint64_t{bytes.size()});
  file.write(head.bytes());
  file.write(bytes);
  ByteWriter tail;
  tail.put(crc32_of(bytes, crc32_of(head.bytes())));
  file.write(tail.bytes());
}

void put_head(EntryWriter& out, const Rig& rig, const GraphSnapshot& graph) {
  out.put(rig.kind);
  const PinholeCamera& c = rig.camera;
  for (const double value : {c.fx, c.fy, c.cx, c.cy}) out.put(value);
  out.put(std::int32_t{c.width});
  out.put(std::int32_t{c.height});
  for (const double value : {rig.baseline, rig.depth_unit, rig.depth_min, rig.depth_max}) out.put(value);
  out.put(graph.version());
  out.put(graph.reference());
  out.put(static_cast<std::uint32_t>(graph.keyframe_count()));
  out.put(static_cast<std::uint32_t>(graph.point_count()));
}

/// Edges are written by their newer keyframe.
void put_edges(EntryWriter& out, const Keyframe& keyframe) {
  std::uint32_t count = 0;
  for (const Edge& edge : *keyframe.edges) count += edge.other < keyframe.id ? 1 : 0;
  out.put(count);
  for (const Edge& edge : *keyframe.edges) {
    if (edge.other > keyframe.id) continue;
    out.put(edge.other);
    out.put(std::int32_t{edge.weight});
    out.put(static_cast<std::uint8_t>(edge.marginalised));
    out.put(edge.T_other_this);
    out.put(0.0);  // in the place of a number that older programs kept with an edge
  }
}

bool is_forgotten(const GraphSnapshot& graph, std::uint32_t k) {
  return graph.keyframe(KeyframeId{k}).culled() && graph.replacement(KeyframeId{k}).id == kNoKeyframe;
}

bool is_culled_point(const GraphSnapshot& graph, std::uint32_t p) {
  return graph.point(PointId{p}).culled();
}

/// Number of entries from `begin` on, up to `end`, that are `like` it.
template <class Like>
std::uint32_t run_length(std::uint32_t begin, std::uint32_t end, Like&& like) {
  std::uint32_t i = begin;
  while (i < end && like(i)) ++i;
  return i - begin;
}

void put_culled(EntryWriter& out, const Replacement& replacement) {
  out.put(EntryKind::kCulled);
  out.put(replacement.id);
  out.put(replacement.T_this_replacement.unpacked());
}

void put_keyframe(EntryWriter& out, const Keyframe& keyframe) {
  out.put(EntryKind::kKeyframe);
  out.put(keyframe.frame_index);
  out.put(keyframe.t_ns);
  out.put(keyframe.T_k_w);
  out.put(keyframe.median_depth);
  out.put(static_cast<std::uint32_t>(keyframe.observations->size()));
  for (const Observation& observation : *keyframe.observations) {
    out.put(observation.point);
    out.put_vector(observation.pixel);
    out.put(observation.level);
  }
  put_edges(out, keyframe);
}

/// Keyframe k, or all forgotten ones from there on.
/// @return how many
std::uint32_t put_keyframes(EntryWriter& out, const GraphSnapshot& graph, std::uint32_t k) {
  const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
  const auto count = static_cast<std::uint32_t>(graph.keyframe_count());
  if (const std::uint32_t run = run_length(k, count, [&](auto n) { return is_forgotten(graph, n); })) {
    out.put(EntryKind::kForgotten);
    out.put(run);
    return run;
  }
  if (keyframe.culled()) {
    put_culled(out, graph.replacement(KeyframeId{k}));
  } else {
    put_keyframe(out, keyframe);
  }
  return 1;
}

/// Observers follow from the keyframes' observations.
void put_point(EntryWriter& out, const MapPoint& point) {
  out.put(point.anchor);
  out.put_vector(point.psi);
  out.put(static_cast<std::uint8_t>(point.appearance != nullptr));
  if (point.appearance == nullptr) return;
  out.put_vector(point.appearance->uv);
  out.put(point.appearance->level);
  out.put_bytes(point.appearance->pixels);
}

/// Point p, or all culled ones from there on.
/// @return how many
std::uint32_t put_points(EntryWriter& out, const GraphSnapshot& graph, std::uint32_t p) {
  const auto count = static_cast<std::uint32_t>(graph.point_count());
  if (const std::uint32_t run = run_length(p, count, [&](auto n) { return is_culled_point(graph, n); })) {
    out.put(kNoKeyframe);  // as the anchor
    out.put(run);
    return run;
  }
  put_point(out, graph.point(PointId{p}));
  return 1;
}

void put_place(EntryWriter& out, KeyframeId id, const PlaceAppearance& place) {
  out.put(id);
  out.put(static_cast<std::uint32_t>(place.corners.size()));
  for (std::size_t n = 0; n < place.corners.size(); ++n) {
    const DescribedCorner& corner = place.corners[n];
    out.put_vector(corner.uv);
    out.put(n < place.pixels.size() ? place.pixels[n].z() : static_cast<float>(Rig::kNoRight));
    out.put(corner.level);
    out.put(corner.angle);
    out.put_bytes(
        {reinterpret_cast<const std::uint8_t*>(corner.descriptor.bits.data()), sizeof(BinaryDescriptor)});
  }
}

/// Writes what there is of [0, count) in sections of up to `per_section` entries.
/// @param put  puts one entry, for i and maybe for what follows, into an EntryWriter, or nothing, if there is
///             nothing to put for i; returns for how many it did, at least 1
template <class Put>
void write_slices(ReplacedFile& file, Section section, std::uint32_t count, std::uint32_t per_section,
                  Put&& put) {
  EntryWriter bytes;
  std::uint32_t entries = 0;
  for (std::uint32_t i = 0; i < count;) {
    const std::size_t before = bytes.bytes().size();
    i += put(bytes, i);
    entries += bytes.bytes().size() > before ? 1 : 0;
    if (entries == 0 || (entries < per_section && i < count)) continue;
    write_section(file, section, bytes.bytes());
    bytes.clear();
    entries = 0;
  }
}

void expect_loadable(const fs::path& file, const GraphSnapshot& graph) {
  if (graph.keyframe_count() <= kMaxKeyframes && graph.point_count() <= kMaxPoints) return;
  throw MapFileError(file.string() +
                     ": the map is too large to be saved: " + std::to_string(graph.keyframe_count()) +
                     " keyframes, " + std::to_string(graph.point_count()) + " points have been made");
}

/// Only a map is replaced: whatever else has the name would be lost.
void expect_replaceable(const fs::path& file) {
  const auto refuse = [&](const char* why) { throw MapFileError(file.string() + ": " + why); };
  const fs::path target = followed(file);
  std::error_code error;
  const fs::file_status status = fs::status(target, error);
  if (!fs::exists(status)) return;
  if (fs::is_directory(status)) refuse("is a folder, no file that a map could be written to");
  if (!fs::is_regular_file(status)) refuse("is no regular file: no map is written to it");
  if (fs::file_size(target, error) > 0 && !begins_as_map(target))
    refuse("is there already and no map: it is not overwritten");
}

}  // namespace

void expect_place_for_map(const fs::path& file) {
  expect_replaceable(file);
  const ReplacedFile probe(file);  // whose temporary file goes again
}

void save_map(const fs::path& file, const Rig& rig, const GraphSnapshot& graph,
              const KeyframeDatabase& places) {
  expect_loadable(file, graph);
  expect_replaceable(file);
  ReplacedFile out(file);
  EntryWriter bytes;
  for (const char c : kMagic) bytes.put(c);
  bytes.put(kMapFormatVersion);
  bytes.put(std::uint8_t{0});
  out.write(bytes.bytes());
  bytes.clear();
  put_head(bytes, rig, graph);
  write_section(out, Section::kHead, bytes.bytes());
  write_slices(out, Section::kKeyframes, static_cast<std::uint32_t>(graph.keyframe_count()),
               kKeyframesPerSection,
               [&](EntryWriter& to, std::uint32_t k) { return put_keyframes(to, graph, k); });
  write_slices(out, Section::kPoints, static_cast<std::uint32_t>(graph.point_count()), kPointsPerSection,
               [&](EntryWriter& to, std::uint32_t p) { return put_points(to, graph, p); });
  const std::size_t described = std::min(places.size(), graph.keyframe_count());
  write_slices(out, Section::kPlaces, static_cast<std::uint32_t>(described), kPlacesPerSection,
               [&](EntryWriter& to, std::uint32_t k) {
                 const PlaceAppearance* place = places.find(KeyframeId{k});
                 if (place != nullptr && !graph.keyframe(KeyframeId{k}).culled())
                   put_place(to, KeyframeId{k}, *place);
                 return 1U;
               });
  write_section(out, Section::kEnd, {});
  out.commit();
}

}  // namespace twofold
