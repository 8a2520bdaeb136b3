#include "engine/logs/schedule_records.hpp"

#include "base/check.hpp"
#include "engine/logs/varint.hpp"

namespace twofold {

// Tracker record: flags (1 fate, 2 has messages, 8 keyframe withheld, effort level in the upper half; 4 was
// of format 2 and is free), frame and version as differences, then the number of messages if the flags
// announce it.
void encode_step(ByteWriter& bytes, const TrackerStep& step, const TrackerStep& last) {
  TWOFOLD_CHECK(step.effort_level <= 15, "effort level");
  const unsigned flags = static_cast<unsigned>(step.fate) | (step.messages ? 2U : 0U) |
                         (step.keyframe_withheld ? 8U : 0U) | static_cast<unsigned>(step.effort_level) << 4;
  bytes.put(static_cast<std::uint8_t>(flags));
  put_varint(bytes, zigzag(static_cast<std::uint64_t>(step.frame), static_cast<std::uint64_t>(last.frame)));
  put_varint(bytes, zigzag(step.version, last.version));
  if (step.messages) put_varint(bytes, step.messages);
}
TrackerStep decode_step(ByteReader& in, const TrackerStep& last) {
  TrackerStep step;
  const unsigned flags = in.u8();
  step.fate = static_cast<TrackerStep::Fate>(flags & 1U);
  step.effort_level = static_cast<std::uint8_t>(flags >> 4);
  step.keyframe_withheld = (flags & 8U) != 0;
  step.frame = static_cast<std::int64_t>(unzigzag(take_varint(in), static_cast<std::uint64_t>(last.frame)));
  step.version = unzigzag(take_varint(in), last.version);
  if (flags & 2U) step.messages = take_varint32(in);
  return step;
}

void encode_step(ByteWriter& bytes, const MapperStep& step, const MapperStep& last) {
  put_varint(bytes, zigzag(step.version, last.version));
  put_varint(bytes, step.proposals);
  put_varint(bytes, step.loop_messages);
}
MapperStep decode_step(ByteReader& in, const MapperStep& last) {
  MapperStep step;
  step.version = unzigzag(take_varint(in), last.version);
  step.proposals = take_varint32(in);
  step.loop_messages = take_varint32(in);
  return step;
}

void encode_step(ByteWriter& bytes, const LoopStep& step, const LoopStep& last) {
  put_varint(bytes, zigzag(step.version, last.version));
  put_varint(bytes,
             zigzag(static_cast<std::uint64_t>(step.keyframe), static_cast<std::uint64_t>(last.keyframe)));
  put_varint(bytes, step.requests);
  put_varint(bytes, step.refused);
}
LoopStep decode_step(ByteReader& in, const LoopStep& last) {
  LoopStep step;
  step.version = unzigzag(take_varint(in), last.version);
  step.keyframe =
      static_cast<std::int64_t>(unzigzag(take_varint(in), static_cast<std::uint64_t>(last.keyframe)));
  step.requests = take_varint32(in);
  step.refused = take_varint32(in);
  return step;
}

void check_order(const TrackerStep& step, const TrackerStep* last) {
  if (step.frame < 0 || (last != nullptr && step.frame <= last->frame))
    throw MalformedBytes("has frames out of order");
}
void check_order(const MapperStep&, const MapperStep*) {}
void check_order(const LoopStep& step, const LoopStep*) {
  if (step.keyframe < -1) throw MalformedBytes("has a negative keyframe number");
}

}  // namespace twofold
