// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/number_picture.h>

#include <scenegraph/io/json.h>

#include <OpenImageIO/imageio.h>

#include <fstream>

namespace stipple {

namespace {

constexpr int kMaxSide = 32768;  // pixels

// OpenImageIO's name of the format, by the file's first bytes; nullptr for any other. Few formats
// only: every further decoder would be one more way in for a damaged file.
const char* formatOf(const std::string& head) {
    using namespace std::string_literals;
    if (head.starts_with("\x89PNG\r\n\x1a\n")) return "png";
    if (head.starts_with("\xff\xd8\xff")) return "jpeg";
    if (head.starts_with("II*\0"s) || head.starts_with("MM\0*"s)) return "tiff";
    if (head.starts_with("\x76\x2f\x31\x01")) return "openexr";
    if (head.starts_with("#?RADIANCE") || head.starts_with("#?RGBE")) return "hdr";
    return nullptr;
}

}  // namespace

NumberPicture readNumberPicture(const std::filesystem::path& path, const MemoryBudget& budget,
                                const std::string& where) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error))
        throw Error(ErrorCode::kFileNotFound, where, "is not a file");
    std::string head(16, '\0');
    std::ifstream(path, std::ios::binary).read(head.data(), std::streamsize(head.size()));
    const char* format = formatOf(head);
    if (!format) {
        throw Error(ErrorCode::kUnsupported, where,
                    "not a PNG, JPEG, TIFF, OpenEXR or Radiance HDR picture");
    }
    const auto fail = [&](const std::string& reason) {
        throw Error(ErrorCode::kParse, where,
                    std::string("damaged ") + format + " picture: " + oneLine(reason));
    };
    const auto input = OIIO::ImageInput::create(format);
    if (!input)
        throw Error(ErrorCode::kUnsupported, where,
                    std::string("OpenImageIO cannot read ") + format);
    OIIO::ImageSpec spec, hints;
    hints["oiio:UnassociatedAlpha"] = 1;
    if (!input->open(path.string(), spec, hints)) fail(input->geterror());
    if (spec.width < 1 || spec.height < 1 || spec.width > kMaxSide || spec.height > kMaxSide ||
        spec.depth > 1 || spec.nchannels < 1 || spec.nchannels > 64) {
        fail(std::to_string(spec.width) + " x " + std::to_string(spec.height) + " pixels of " +
             std::to_string(spec.nchannels) + " channels are too many or none");
    }
    NumberPicture picture;
    picture.width = spec.width, picture.height = spec.height;
    picture.channels = spec.nchannels >= 3 ? 3 : 1;
    picture.is_float = spec.format.is_floating_point();
    const size_t n = size_t(spec.width) * size_t(spec.height) * size_t(picture.channels);
    budget.require(double(n) * 2.0 * sizeof(float), where,
                   std::to_string(spec.width) + " x " + std::to_string(spec.height) + " pixels");
    picture.values.resize(n);
    if (!input->read_image(0, 0, 0, picture.channels, OIIO::TypeDesc::FLOAT, picture.values.data()))
        fail(input->geterror());
    return picture;
}

}  // namespace stipple
