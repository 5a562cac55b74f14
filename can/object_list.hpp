/// The consumer's side of the object list: header and halves of objects to a list that is whole, or known not
/// to be.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "can/messages.hpp"

namespace can {

struct ObjectListCounters {
    std::uint32_t complete = 0;
    std::uint32_t torn = 0;  ///< lists of which something was still missing when the next header came
    std::uint32_t stray =
        0;  ///< halves that belong to no list: other cycle, or index beyond the header's count
};

/// Takes what can::Receiver has accepted, in the order of arrival. The list on show is always the last
/// complete one; a torn list is never shown.
class ObjectListReader {
  public:
    /// Starts a list. True: it is complete, because it is empty.
    bool header(const ObjectListHeader& header);
    /// One half of an object; true: it completed the list.
    bool kinematics(const Object& object);
    bool quality(const Object& object);

    /// Header and objects of the last complete list; before the first, a header that is not valid and no
    /// objects.
    const ObjectListHeader& last_header() const { return complete_header_; }
    std::span<const Object> objects() const { return std::span(complete_).first(complete_header_.count); }

    /// Something of the current list has not come yet.
    bool pending() const { return pending_; }
    const ObjectListCounters& counters() const { return counters_; }

  private:
    bool belongs(const Object& object);
    bool finish_if_complete();

    ObjectListHeader header_;
    std::array<Object, kMaxObjects> objects_{};
    std::uint32_t missing_kinematics_ = 0;  ///< one bit an index
    std::uint32_t missing_quality_ = 0;
    bool pending_ = false;

    ObjectListHeader complete_header_;
    std::array<Object, kMaxObjects> complete_{};
    ObjectListCounters counters_;
};

}  // namespace can
