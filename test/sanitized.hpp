// SPDX-License-Identifier: Apache-2.0
#pragma once

// DYNID_SANITIZED: under the address or the thread sanitizer, which have a malloc of their own and make
// everything several times slower. `sanitized` is the same as a value.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)  // GCC
#define DYNID_SANITIZED
#elif defined(__has_feature)  // Clang
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define DYNID_SANITIZED
#endif
#endif

namespace dynid::test {

#ifdef DYNID_SANITIZED
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

}  // namespace dynid::test
