#pragma once

#include "base/bytes.hpp"
#include "engine/logs/schedule_log.hpp"

namespace twofold {

// One record of each thread's stream as bytes, relative to the record before.

void encode_step(ByteWriter& bytes, const TrackerStep& step, const TrackerStep& last);
void encode_step(ByteWriter& bytes, const MapperStep& step, const MapperStep& last);
void encode_step(ByteWriter& bytes, const LoopStep& step, const LoopStep& last);

/// The bytes may be anything. All throw MalformedBytes when they are no record.
[[nodiscard]] TrackerStep decode_step(ByteReader& in, const TrackerStep& last);
[[nodiscard]] MapperStep decode_step(ByteReader& in, const MapperStep& last);
[[nodiscard]] LoopStep decode_step(ByteReader& in, const LoopStep& last);

/// Throw MalformedBytes when a record of good form cannot follow the one before (null: it is the first).
void check_order(const TrackerStep& step, const TrackerStep* last);
void check_order(const MapperStep& step, const MapperStep* last);
void check_order(const LoopStep& step, const LoopStep* last);

}  // namespace twofold
