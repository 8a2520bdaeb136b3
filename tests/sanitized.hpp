#pragma once

namespace twofold::testing {

/// This build is several times slower than the product, so that a run at recorded pace must be given time.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace twofold::testing
