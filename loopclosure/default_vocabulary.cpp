#include "loopclosure/default_vocabulary.hpp"

// The file's bytes, put between two labels by the assembler. They are global, if hidden: local ones of a
// section share one entry of the table that position-independent code for ARM looks addresses up in.
__asm__(
    ".section .rodata\n"
    ".globl twofold_vocabulary_begin, twofold_vocabulary_end\n"
    ".hidden twofold_vocabulary_begin, twofold_vocabulary_end\n"
    ".balign 16\n"
    "twofold_vocabulary_begin:\n"
    ".incbin \"" TWOFOLD_VOCABULARY_FILE
    "\"\n"
    "twofold_vocabulary_end:\n"
    ".byte 0\n"
    ".text\n");

extern "C" {
[[gnu::visibility("hidden")]] extern const std::uint8_t twofold_vocabulary_begin[];
[[gnu::visibility("hidden")]] extern const std::uint8_t twofold_vocabulary_end[];
}

namespace twofold {

Vocabulary load_default_vocabulary() {
  return Vocabulary::parse({twofold_vocabulary_begin, twofold_vocabulary_end}, "built-in vocabulary");
}

}  // namespace twofold
