#include <filesystem>
#include <fstream>
#include <string>

#include "hal/host/frame_file_source.hpp"

#include <CppUTest/TestHarness.h>

TEST_GROUP(FrameFileSource) {
    std::filesystem::path file = std::filesystem::temp_directory_path() / "frame_file_test.bin";
    void teardown() {
        std::filesystem::remove(file);
    }

    static std::string error_of(const std::filesystem::path& path) {
        try {
            hal::FrameFileSource source(path);
        } catch (const hal::FrameFileError& e) {
            return e.what();
        }
        return "";
    }
};

TEST(FrameFileSource, GivesBackWhatWasWrittenThenEnds) {
    dsp::BeatFrame first;
    first.chirp[0][0] = -2048;
    first.chirp[63][63] = 2047;
    dsp::BeatFrame second;
    second.chirp[1][0] = 0x1234;
    {
        hal::FrameFileWriter writer(file);
        writer.write(first);
        writer.write(second);
    }
    LONGS_EQUAL(16384, std::filesystem::file_size(file));
    {
        // Little-endian, sample 0 of chirp 1 of frame 1.
        std::ifstream raw(file, std::ios::binary);
        raw.seekg(8192 + 128);
        LONGS_EQUAL(0x34, raw.get());
        LONGS_EQUAL(0x12, raw.get());
    }
    hal::FrameFileSource source(file);
    LONGS_EQUAL(2, source.frames());
    dsp::BeatFrame frame;
    std::uint32_t sequence = 99;
    CHECK(source.acquire(frame, sequence) == hal::BeatResult::ok);
    LONGS_EQUAL(0, sequence);
    CHECK(frame.chirp == first.chirp);
    CHECK(source.acquire(frame, sequence) == hal::BeatResult::ok);
    LONGS_EQUAL(1, sequence);
    CHECK(frame.chirp == second.chirp);
    CHECK(source.acquire(frame, sequence) == hal::BeatResult::ended);
    CHECK(source.acquire(frame, sequence) == hal::BeatResult::ended);
}

TEST(FrameFileSource, NamesFileAndSizeWhenItIsNotMadeOfFrames) {
    std::ofstream(file) << std::string(8192 + 100, 'x');
    STRCMP_CONTAINS("frame_file_test.bin: 8292 bytes are 1 frames of 8192 bytes and 100 bytes more",
                    error_of(file).c_str());
    std::ofstream(file, std::ios::trunc).close();
    STRCMP_CONTAINS("frame_file_test.bin: is empty", error_of(file).c_str());
    STRCMP_CONTAINS("/nowhere/frames.bin: no such file", error_of("/nowhere/frames.bin").c_str());
    STRCMP_CONTAINS("is not a regular file", error_of(std::filesystem::temp_directory_path()).c_str());
}

TEST(FrameFileSource, AFileThatShrinksWhileItIsReadGivesAnInvalidFrame) {
    std::ofstream(file) << std::string(3 * 8192, 'x');
    hal::FrameFileSource source(file);
    std::filesystem::resize_file(file, 0);
    dsp::BeatFrame frame;
    std::uint32_t sequence = 0;
    CHECK(source.acquire(frame, sequence) == hal::BeatResult::invalid);
    LONGS_EQUAL(0, frame.chirp[0][0]);
}

TEST(FrameFileSource, AFileThatCannotBeCreatedIsNamed) {
    try {
        hal::FrameFileWriter writer("/nowhere/out.bin");
        FAIL("created");
    } catch (const hal::FrameFileError& e) {
        STRCMP_CONTAINS("/nowhere/out.bin: cannot be created", e.what());
    }
}
