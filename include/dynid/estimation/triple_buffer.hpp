// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>

namespace dynid {

/// Hands the latest value of T from one writing thread to one reading thread. Both are wait-free: neither
/// ever waits for the other, or retries. Three copies are made at the start, one for each thread and one in
/// the middle; the reader only ever exchanges two indices, so nothing is copied, allocated or freed on its
/// side.
template <class T>
class TripleBuffer {
 public:
  explicit TripleBuffer(const T& value) : slots_{Slot{value}, Slot{value}, Slot{value}} {}
  TripleBuffer(const TripleBuffer&) = delete;
  TripleBuffer& operator=(const TripleBuffer&) = delete;

  /// Writer: makes `value` the one that the reader takes next. A value that was not yet taken is dropped.
  /// Throws and allocates where the assignment of T does.
  void publish(const T& value) {
    slots_[back_].value = value;
    back_ = middle_.exchange(back_ | fresh, std::memory_order_acq_rel) & index;
  }

  /// Reader: takes the newest value, if there is one that it does not have; says whether there was.
  bool update() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & fresh) == 0) return false;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & index;
    return true;
  }
  /// Reader: the value taken last. It stays as it is until the next update().
  const T& front() const noexcept { return slots_[front_].value; }
  T& front() noexcept { return slots_[front_].value; }

 private:
  static constexpr unsigned index = 3, fresh = 4;
  static_assert(std::atomic<unsigned>::is_always_lock_free);
  struct alignas(64) Slot {  // cache lines of its own
    T value;
  };

  std::array<Slot, 3> slots_;
  alignas(64) std::atomic<unsigned> middle_{1};
  alignas(64) unsigned back_ = 2;   // the writer's
  alignas(64) unsigned front_ = 0;  // the reader's
};

}  // namespace dynid
