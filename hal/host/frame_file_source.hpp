/// Beat frames from a recording: little-endian int16, [frame][chirp][sample], 8192 bytes a frame, no header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "hal/contract/beat_source.hpp"

namespace hal {

/// A recording that cannot be read or written; what() names the file, and its size where that is wrong.
class FrameFileError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

class FrameFileSource final : public BeatSource {
  public:
    /// Throws FrameFileError when the file is missing, unreadable, empty, or no whole number of frames.
    explicit FrameFileSource(const std::filesystem::path& file);

    [[nodiscard]] std::uint64_t frames() const { return frames_; }
    BeatResult acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) override;

  private:
    std::ifstream in_;
    std::uint64_t frames_ = 0;
    std::uint32_t next_ = 0;
};

class FrameFileWriter {
  public:
    /// Throws FrameFileError when the file cannot be created.
    explicit FrameFileWriter(const std::filesystem::path& file);
    /// Throws FrameFileError when the disk is full.
    void write(const dsp::BeatFrame& frame);

  private:
    std::filesystem::path file_;
    std::ofstream out_;
};

}  // namespace hal
