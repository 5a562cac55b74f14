#include "hal/host/frame_file_source.hpp"

#include <bit>
#include <string>
#include <system_error>

namespace hal {

static_assert(std::endian::native == std::endian::little,
              "frame files are read and written as they lie in memory");

FrameFileSource::FrameFileSource(const std::filesystem::path& file) {
    const std::string name = file.string();
    std::error_code error;
    if (!std::filesystem::exists(file, error)) throw FrameFileError(name + ": no such file");
    if (!std::filesystem::is_regular_file(file, error))
        throw FrameFileError(name + ": is not a regular file");
    in_.open(file, std::ios::binary);
    const auto bytes = std::filesystem::file_size(file, error);
    if (!in_ || error) throw FrameFileError(name + ": cannot be read");
    if (bytes == 0)
        throw FrameFileError(name + ": is empty; a frame has " + std::to_string(sizeof(dsp::BeatFrame)) +
                             " bytes");
    frames_ = bytes / sizeof(dsp::BeatFrame);
    if (const auto rest = bytes % sizeof(dsp::BeatFrame); rest != 0) {
        throw FrameFileError(name + ": " + std::to_string(bytes) + " bytes are " + std::to_string(frames_) +
                             " frames of " + std::to_string(sizeof(dsp::BeatFrame)) + " bytes and " +
                             std::to_string(rest) +
                             " bytes more; is it a recording of 64 x 64 int16 samples?");
    }
}

BeatResult FrameFileSource::acquire(dsp::BeatFrame& frame, std::uint32_t& sequence) {
    if (next_ >= frames_) return BeatResult::ended;
    sequence = next_++;
    dsp::BeatFrame read;
    in_.read(reinterpret_cast<char*>(&read), sizeof(read));
    if (!in_) return BeatResult::invalid;
    frame = read;
    return BeatResult::ok;
}

FrameFileWriter::FrameFileWriter(const std::filesystem::path& file)
    : file_(file), out_(file, std::ios::binary) {
    if (!out_) throw FrameFileError(file.string() + ": cannot be created");
}

void FrameFileWriter::write(const dsp::BeatFrame& frame) {
    out_.write(reinterpret_cast<const char*>(&frame), sizeof(frame));
    if (!out_.flush()) throw FrameFileError(file_.string() + ": cannot be written, is the disk full?");
}

}  // namespace hal
