// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/instance_buffer.h>
#include <scenegraph/io/transform.h>

#include <bit>
#include <cstring>

namespace stipple {

namespace {

static_assert(std::endian::native == std::endian::little, "records are read as they are");

struct Record {
    uint32_t child;
    float translation[3], rotation[4], scale[3];
};
static_assert(sizeof(Record) == 44);

constexpr size_t kChunkRecords = 16384;
constexpr double kMaxLength = 1e9, kMaxFactor = 1e6;  // as for instances in JSON

Record recordAt(const std::string& bytes, size_t i) {
    Record record;
    std::memcpy(&record, bytes.data() + i * sizeof(Record), sizeof(Record));
    return record;
}

bool isWithin(const float* values, int n, double limit) {
    for (int i = 0; i < n; ++i) {
        if (!(std::abs(double(values[i])) <= limit)) return false;
    }
    return true;
}

// nullptr, or what is wrong.
const char* makeTransform(const Record& r, const DVec3& origin, Affine& result) {
    if (!isWithin(r.translation, 3, kMaxLength) || !isWithin(r.rotation, 4, kMaxFactor) ||
        !isWithin(r.scale, 3, kMaxFactor)) {
        return "holds a number that is too large or none";
    }
    const double q[4] = {r.rotation[0], r.rotation[1], r.rotation[2], r.rotation[3]};
    DMat3 rotation;
    if (!rotationFromQuaternion(q, rotation)) return "has a quaternion of zero";
    result = affineFromParts(origin + DVec3(r.translation[0], r.translation[1], r.translation[2]),
                             rotation, DVec3(r.scale[0], r.scale[1], r.scale[2]));
    return isSingular(result.linear) ? "flattens what it places" : nullptr;
}

}  // namespace

InstanceBuffer::InstanceBuffer(SceneReader& reader, const Json& source, const JsonPath& path)
    : reader_(reader), path_(path) {
    const Json& names = source["children"];
    for (size_t i = 0; i < names.size(); ++i) {
        children_.push_back(reader.child(names[i].get_ref<const std::string&>(),
                                         joined(path, {"children", std::to_string(i)})));
    }
    readVector(source, "origin", origin_);
    const JsonPath file_path = joined(path, {"file"});
    const std::string where = reader.where(file_path);
    bytes_ = readFile(reader.file(source["file"], file_path), reader.context.budget, where);
    if (bytes_.size() % sizeof(Record) != 0) {
        throw Error(ErrorCode::kParse, where,
                    std::to_string(bytes_.size()) + " bytes are no whole number of records of " +
                        std::to_string(sizeof(Record)) + " bytes");
    }
}

size_t InstanceBuffer::size() const { return bytes_.size() / sizeof(Record); }

DBox3 InstanceBuffer::domain() const {
    const size_t n_chunks = (size() + kChunkRecords - 1) / kChunkRecords;
    std::vector<DBox3> boxes(n_chunks);
    reader_.pool.forEach(n_chunks, [&](size_t chunk, int) {
        const size_t end = std::min(size(), (chunk + 1) * kChunkRecords);
        for (size_t i = chunk * kChunkRecords; i < end; ++i) {
            const Record r = recordAt(bytes_, i);
            if (isWithin(r.translation, 3, kMaxLength))  // what is wrong is named by addTo()
                boxes[chunk].extend(origin_ +
                                    DVec3(r.translation[0], r.translation[1], r.translation[2]));
        }
    });
    DBox3 domain;
    for (const DBox3& box : boxes) domain.extend(box);
    return domain;
}

void InstanceBuffer::addTo(InstanceStore& store) const {
    const size_t n_chunks = (size() + kChunkRecords - 1) / kChunkRecords;
    struct Problem {
        size_t record = 0;
        const char* text = nullptr;
    };
    std::vector<Problem> problems(n_chunks);
    store.addChunks(reader_.pool, n_chunks, [&](size_t chunk, InstanceStore& part) {
        const size_t end = std::min(size(), (chunk + 1) * kChunkRecords);
        part.reserve(end - chunk * kChunkRecords);
        for (size_t i = chunk * kChunkRecords; i < end && !problems[chunk].text; ++i) {
            const Record record = recordAt(bytes_, i);
            Affine transform;
            const char* problem = record.child < children_.size()
                                      ? makeTransform(record, origin_, transform)
                                      : "names a child beyond the list of children";
            if (problem) {
                problems[chunk] = {i, problem};
            } else {
                part.add(children_[record.child], transform);
            }
        }
    });
    for (const Problem& problem : problems) {
        if (problem.text) {
            reader_.fail(joined(path_, {"file"}),
                         "record " + std::to_string(problem.record) + " " + problem.text);
        }
    }
}

}  // namespace stipple
