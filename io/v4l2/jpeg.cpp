#include "io/v4l2/jpeg.hpp"

#include <cstdio>  // jpeglib.h uses FILE and does not include this

#include <jerror.h>
#include <jpeglib.h>

#include <csetjmp>

namespace twofold {
namespace {

/// libjpeg reports through this; its error_exit must not return.
struct ErrorReport {
  jpeg_error_mgr base;  // first: libjpeg hands out a pointer to it
  std::jmp_buf leave;
  char message[JMSG_LENGTH_MAX] = {};
  bool damaged = false;
};

ErrorReport& report_of(j_common_ptr decoder) {
  return *reinterpret_cast<ErrorReport*>(decoder->err);
}

[[noreturn]] void on_error(j_common_ptr decoder) {
  ErrorReport& report = report_of(decoder);
  decoder->err->format_message(decoder, report.message);
  std::longjmp(report.leave, 1);
}

/// Level -1 is a warning: the data are corrupt, and the decoder goes on with something made up. Stray bytes
/// between markers are harmless, and common in cameras' streams.
void on_message(j_common_ptr decoder, int level) {
  ErrorReport& report = report_of(decoder);
  if (level >= 0 || decoder->err->msg_code == JWRN_EXTRANEOUS_DATA || report.damaged) return;
  report.damaged = true;
  decoder->err->format_message(decoder, report.message);
}

struct Target {
  int width, height;
  std::uint8_t* grey;
  std::size_t stride;
};

/// Everything between set-up and clean-up. Nothing here has a destructor: longjmp passes through it.
bool decode(jpeg_decompress_struct* decoder, ErrorReport* report, std::span<const std::uint8_t> file,
            const Target& target) {
  if (setjmp(report->leave) != 0) return false;
  jpeg_create_decompress(decoder);
  jpeg_mem_src(decoder, file.data(), static_cast<unsigned long>(file.size()));
  jpeg_read_header(decoder, TRUE);
  // Before anything is allocated for the size the file claims.
  if (decoder->image_width != static_cast<JDIMENSION>(target.width) ||
      decoder->image_height != static_cast<JDIMENSION>(target.height)) {
    std::snprintf(report->message, sizeof report->message, "the JPEG is %ux%u", decoder->image_width,
                  decoder->image_height);
    return false;
  }
  decoder->out_color_space = JCS_GRAYSCALE;
  decoder->dct_method = JDCT_ISLOW;
  jpeg_start_decompress(decoder);
  while (decoder->output_scanline < decoder->output_height) {
    JSAMPROW row = target.grey + decoder->output_scanline * target.stride;
    jpeg_read_scanlines(decoder, &row, 1);
  }
  jpeg_finish_decompress(decoder);
  return !report->damaged;
}

}  // namespace

tl::expected<void, std::string> decode_jpeg_grey(std::span<const std::uint8_t> file, int width, int height,
                                                 std::uint8_t* grey, std::size_t grey_stride) {
  jpeg_decompress_struct decoder{};
  ErrorReport report{};
  decoder.err = jpeg_std_error(&report.base);
  report.base.error_exit = on_error;
  report.base.emit_message = on_message;
  const bool whole = decode(&decoder, &report, file, {width, height, grey, grey_stride});
  jpeg_destroy_decompress(&decoder);
  if (!whole) return tl::unexpected<std::string>(report.message);
  return {};
}

}  // namespace twofold
