#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

namespace twofold {

// What the viewer's server sends to the page (viewer/page/src/wire.ts reads it). Little-endian; blocks and
// records are multiples of four bytes long, so that the page reads arrays where they lie. Messages are, too,
// but for images, which end with a JPEG.
//
// Binary messages begin with a header:
//   u32 kind      ViewMessageKind
//   u32 number    kDelta: ViewDeltaFlags; kFrames: how many; kImage, kMeasured: frame number;
//                 kKeyframeImage: keyframe; kSurface: kWhole, or 0
//   u32 a, b      kDelta: revisions it leads from and to; kImage, kKeyframeImage: width and height of the
//                 whole image [px]; kMeasured: a is how many points; kSurface: how many pieces, and the
//                 map part; else 0
// and go on with
//   kDelta   blocks: u32 ViewBlock, u32 count, then the records, or, of what is gone, its keys
//   kFrames  ViewLiveFrame, in the order of time
//   kImage   a JPEG
//   kKeyframeImage  likewise; nothing: it has none
//   kSurface  f32 edge of a cell, u32 0, then pieces of the mesh, which replace those of their cells, and
//   with
//             kWhole everything: i32 cell[3], u32 vertices, u32 triangles, ViewSurfaceVertex of each, u16 its
//             three corners of each triangle, two bytes more if their number is odd
//   kMeasured  MeasuredPoint (twofold/frame_details.hpp); comes before the frame itself
// Text messages are JSON: an object with one of the members hello, state, reasons, truth, events, status
// (viewer/texts.hpp).
//
// The page says "ack" for each message, "still there?" after a while without any, which is answered by an
// empty object, "images on", "images off", where hello.keyframeImages is true "keyframe ID", and, where
// hello.control is true, "save map", "stop", "pause mapping", "resume mapping".
//
// A revision counts changes of the scene. A delta from revision 0 is the whole of it, and makes the page
// forget what it had. One that is large comes in several messages; the last has kLast, and until then `from`
// stays the same.
//
// Worlds are those of map parts; poses are T_world_camera; lengths are metres, or, where hello.metres is
// false, of the one camera's own unit; times are seconds since the scene's first moment.

inline constexpr std::uint32_t kViewProtocol = 5;
static_assert(std::endian::native == std::endian::little, "records are sent as they lie in memory");

inline constexpr std::uint32_t kViewNotKnown = 0xffffffffU;  ///< of numbers that may not be known

enum class ViewMessageKind : std::uint32_t {
  kDelta = 1,
  kFrames = 2,
  kImage = 3,
  kMeasured = 4,
  kKeyframeImage = 5,
  kSurface = 6
};

enum ViewDeltaFlags : std::uint32_t { kWhole = 1, kLast = 2 };

enum class ViewBlock : std::uint32_t {
  kPoints = 1,
  kPointsGone = 2,
  kKeyframes = 3,
  kKeyframesGone = 4,
  kEdges = 5,
  kEdgesGone = 6,  ///< keys are of 64 bit: `to` first, then `from`
  kPath = 7,
  kPathGone = 8,
};

struct ViewMessageHeader {
  ViewMessageKind kind = ViewMessageKind::kDelta;
  std::uint32_t number = 0;
  std::uint32_t a = 0;
  std::uint32_t b = 0;
};
static_assert(sizeof(ViewMessageHeader) == 16);

struct ViewPoint {
  std::uint32_t id = 0;
  float position[3] = {};
  std::uint32_t part = 0;
  std::uint32_t anchor = 0;    ///< keyframe it was first seen in: the greater, the younger
  std::uint8_t observers = 0;  ///< keyframes that see it, at most 255
  std::uint8_t deviation = 0;  ///< code of its largest standard deviation: 2^((code - 128) / 8) m; 0: unknown
  std::uint16_t unused = 0;

  [[nodiscard]] std::uint32_t key() const { return id; }
};
static_assert(sizeof(ViewPoint) == 28);

struct ViewKeyframe {
  std::uint32_t id = 0;
  std::uint32_t part = 0;
  std::uint32_t frame = kViewNotKnown;  ///< not known: of the map that the run went on with
  float t = 0;                          ///< [s]
  float position[3] = {};
  float orientation[4] = {0, 0, 0, 1};  ///< x, y, z, w
  std::uint32_t points = 0;             ///< it sees
  std::uint8_t window = 0;              ///< 1, 2: in W1, W2; 0: in neither
  std::uint8_t has_place = 0;           ///< can be recognised
  std::uint16_t unused = 0;

  [[nodiscard]] std::uint32_t key() const { return id; }
};
static_assert(sizeof(ViewKeyframe) == 52);

enum ViewLoop : std::uint8_t {
  kNoLoop = 0,
  kClosesLoop = 1,
  kJoinsParts = 2,  ///< its ends were in two map parts
};

struct ViewEdge {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  std::uint16_t shared_points = 0;
  std::uint8_t marginalised = 0;
  std::uint8_t loop = 0;  ///< ViewLoop: of MapSnapshot::loops, not of its length in time

  [[nodiscard]] std::uint64_t key() const { return std::uint64_t{from} << 32 | to; }
};
static_assert(sizeof(ViewEdge) == 12);

/// ViewPathFrame::state, beside those of TrackingState: never looked at, because its successor was there.
inline constexpr std::uint8_t kViewDropped = 3;

/// A frame of the path. Its final pose is that of its reference keyframe, as it is now, times its pose in
/// that.
struct ViewPathFrame {
  std::uint32_t frame = 0;
  float t = 0;                  ///< [s]
  std::uint32_t reference = 0;  ///< keyframe; none: final is causal
  std::uint32_t part = 0;
  std::uint8_t state = 0;   ///< TrackingState or kViewDropped
  std::uint8_t reason = 0;  ///< why it is lost, or late in a finished run: index into the newest "reasons"
  std::uint8_t keyframe = 0;
  std::uint8_t effort = 0;
  float latency_ms = 0;
  float causal[3] = {};                       ///< position when the pose was given out
  float in_reference[3] = {};                 ///< position in the reference keyframe's camera
  std::int16_t turned[4] = {0, 0, 0, 32767};  ///< orientation in it: quaternion (x, y, z, w) times 32767
  float tracking_ms = 0;                      ///< that the tracker worked on it; 0: not known

  [[nodiscard]] std::uint32_t key() const { return frame; }
};
static_assert(sizeof(ViewPathFrame) == 60);

/// Of the surface's mesh. The cell lies from a quarter of the range of positions to three quarters.
struct ViewSurfaceVertex {
  std::uint16_t position[3] = {};
  std::int8_t normal[3] = {};  ///< times 127
  std::uint8_t colour[3] = {};
};
static_assert(sizeof(ViewSurfaceVertex) == 12);

inline constexpr int kViewStages = 8;

/// A frame as soon as its pose is known.
struct ViewLiveFrame {
  std::uint32_t frame = 0;
  float t = 0;  ///< [s]
  std::uint32_t reference = 0;
  std::uint32_t part = 0;
  std::uint8_t state = 0;
  std::uint8_t reason = 0;
  std::uint8_t keyframe = 0;
  std::uint8_t effort = 0;
  float position[3] = {};
  float orientation[4] = {0, 0, 0, 1};
  float tracked_share = 0;
  std::uint32_t points = 0;
  float latency_ms = 0;
  std::uint32_t map_version = 0;
  float stage_ms[kViewStages] = {};  ///< in the order of hello.stages
  // Or kViewNotKnown.
  std::uint32_t keyframes_waiting = kViewNotKnown;  ///< for the mapper
  std::uint32_t frames_waiting = kViewNotKnown;     ///< for the tracker
  std::uint32_t places_waiting = kViewNotKnown;     ///< keyframes, for the loop closer
  std::uint32_t frames_dropped = kViewNotKnown;     ///< that came and were not tracked, so far
  std::uint32_t frames_lost = kViewNotKnown;        ///< that never came: lost by the camera, so far
};
static_assert(sizeof(ViewLiveFrame) == 116 && std::is_trivially_copyable_v<ViewLiveFrame>);

}  // namespace twofold
