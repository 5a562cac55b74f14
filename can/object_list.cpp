#include "can/object_list.hpp"

namespace can {

bool ObjectListReader::header(const ObjectListHeader& header) {
    if (pending_) ++counters_.torn;
    header_ = header;
    if (header_.count > kMaxObjects) header_.count = kMaxObjects;
    missing_kinematics_ = (1u << header_.count) - 1u;
    missing_quality_ = missing_kinematics_;
    pending_ = true;
    return finish_if_complete();
}

bool ObjectListReader::kinematics(const Object& object) {
    if (!belongs(object)) return false;
    Object& kept = objects_[object.index];
    kept.index = object.index;
    kept.cycle = object.cycle;
    kept.track_id = object.track_id;
    kept.range_mm = object.range_mm;
    kept.range_rate_mmps = object.range_rate_mmps;
    kept.motion = object.motion;
    kept.coasting = object.coasting;
    missing_kinematics_ &= ~(1u << object.index);
    return finish_if_complete();
}

bool ObjectListReader::quality(const Object& object) {
    if (!belongs(object)) return false;
    Object& kept = objects_[object.index];
    kept.range_sigma_mm = object.range_sigma_mm;
    kept.range_rate_sigma_mmps = object.range_rate_sigma_mmps;
    kept.existence_percent = object.existence_percent;
    kept.snr_cdb = object.snr_cdb;
    kept.age_cycles = object.age_cycles;
    missing_quality_ &= ~(1u << object.index);
    return finish_if_complete();
}

bool ObjectListReader::belongs(const Object& object) {
    if (pending_ && object.cycle == header_.cycle && object.index < header_.count) return true;
    ++counters_.stray;
    return false;
}

bool ObjectListReader::finish_if_complete() {
    if (!pending_ || missing_kinematics_ != 0 || missing_quality_ != 0) return false;
    pending_ = false;
    complete_header_ = header_;
    complete_ = objects_;
    ++counters_.complete;
    return true;
}

}  // namespace can
