#pragma once

// g++ says it by macros, clang++ 14 only when asked.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
#define TWOFOLD_TEST_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer)
#define TWOFOLD_TEST_SANITIZED 1
#endif
#endif

namespace twofold::testing {

/// This build is several times slower than the product, so that a run at recorded pace must be given time.
#ifdef TWOFOLD_TEST_SANITIZED
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace twofold::testing
