#include "io/bags/chunk_compression.hpp"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

#include "base/bytes.hpp"

namespace twofold {
namespace {

using Input = std::span<const std::uint8_t>;
using Output = std::span<std::uint8_t>;

/// What a decoder did in one call.
struct Decoded {
  std::size_t read = 0, written = 0;
  bool ended = false, failed = false;
};

/// Calls the decoder until its stream ends. Memory grows with what it writes, not with what the file says.
/// @return whether that are `size` bytes
template <class Decoder>
bool unpack(Input packed, std::size_t size, std::vector<std::uint8_t>& unpacked, Decoder decode) {
  constexpr std::size_t kFirstRoom = 1U << 16;
  if (unpacked.size() > size) unpacked.resize(size);
  std::size_t used = 0, done = 0;
  for (;;) {
    if (done == unpacked.size()) unpacked.resize(std::min(size, std::max(kFirstRoom, 2 * done)));
    const Decoded step = decode(packed.subspan(used), Output(unpacked).subspan(done));
    used += step.read;
    done += step.written;
    if (step.ended) return done == size;
    if (step.failed || (step.read == 0 && step.written == 0)) return false;
  }
}

bool unpack_zstd(Input packed, std::size_t size, std::vector<std::uint8_t>& unpacked) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(),
                                                                          &ZSTD_freeDStream);
  return unpack(packed, size, unpacked, [&](Input from, Output to) -> Decoded {
    ZSTD_inBuffer in{from.data(), from.size(), 0};
    ZSTD_outBuffer out{to.data(), to.size(), 0};
    const std::size_t hint = ZSTD_decompressStream(stream.get(), &out, &in);
    return {in.pos, out.pos, hint == 0, ZSTD_isError(hint) != 0};
  });
}

bool unpack_lz4(Input packed, std::size_t size, std::vector<std::uint8_t>& unpacked) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return false;
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owner(
      context, &LZ4F_freeDecompressionContext);
  return unpack(packed, size, unpacked, [&](Input from, Output to) -> Decoded {
    std::size_t read = from.size(), written = to.size();
    const std::size_t hint = LZ4F_decompress(context, to.data(), &written, from.data(), &read, nullptr);
    return {read, written, hint == 0, LZ4F_isError(hint) != 0};
  });
}

bool unpack_bz2(Input packed, std::size_t size, std::vector<std::uint8_t>& unpacked) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> owner(&stream, &BZ2_bzDecompressEnd);
  return unpack(packed, size, unpacked, [&](Input from, Output to) -> Decoded {
    // The library takes the input as one that it might change.
    stream.next_in = reinterpret_cast<char*>(const_cast<std::uint8_t*>(from.data()));
    stream.avail_in = static_cast<unsigned>(from.size());
    stream.next_out = reinterpret_cast<char*>(to.data());
    stream.avail_out = static_cast<unsigned>(to.size());
    const int result = BZ2_bzDecompress(&stream);
    return {from.size() - stream.avail_in, to.size() - stream.avail_out, result == BZ_STREAM_END,
            result != BZ_OK && result != BZ_STREAM_END};
  });
}

}  // namespace

void unpack_chunk(const std::string& compression, std::span<const std::uint8_t> packed, std::uint64_t size,
                  std::vector<std::uint8_t>& unpacked) {
  if (size > kLargestChunk || packed.size() > kLargestChunk)
    throw MalformedBytes("a chunk of more than 512 MiB");
  bool whole = false;
  if (compression == "zstd") {
    whole = unpack_zstd(packed, size, unpacked);
  } else if (compression == "lz4") {
    whole = unpack_lz4(packed, size, unpacked);
  } else if (compression == "bz2") {
    whole = unpack_bz2(packed, size, unpacked);
  } else {
    throw MalformedBytes("a chunk of unknown compression '" + compression + "'");
  }
  if (!whole) throw MalformedBytes("a chunk of " + compression + " is damaged");
}

}  // namespace twofold
