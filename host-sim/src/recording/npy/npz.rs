//! Reading archives of arrays: one structured array, or one array for each of t, x, y, p.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use flate2::read::DeflateDecoder;
use zip::CompressionMethod;

use super::header::{ArrayHeader, Elements};
use super::read::{self, Array, Arrays, Field, NAMES};
use crate::recording::Opened;
use crate::recording::TimeUnit;
use crate::recording::csv::unit_of_name;
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;

fn damaged(what: String) -> RecordingError {
    RecordingError::Damaged { format: "NPZ", place: Place::Byte(0), what }
}

/// One array of the archive.
struct Member {
    name: String,
    start: u64,
    size: u64,
    deflated: bool,
}

/// Opens an archive; it must be a file, since its directory stands at its end.
pub(crate) fn open(path: &Path, time_unit: Option<TimeUnit>) -> Result<Opened, RecordingError> {
    let members = members(path)?;
    // One array with everything in it, whatever its name.
    for member in &members {
        let mut input = input(path, member)?;
        if let Ok(header) = ArrayHeader::read(&mut input)
            && (matches!(&header.elements, Elements::Records(fields) if fields.len() >= 4)
                || header.shape.len() == 2 && header.shape[1] == 4)
        {
            let mut opened = read::open(self::input(path, member)?, time_unit)?;
            opened.format = "NPZ";
            opened.assumed.insert(0, format!("the array \"{}\" holds the events", member.name));
            return Ok(opened);
        }
    }
    columns(path, &members, time_unit)
}

/// One array for each quantity.
fn columns(
    path: &Path,
    members: &[Member],
    time_unit: Option<TimeUnit>,
) -> Result<Opened, RecordingError> {
    let names: Vec<&str> = members.iter().map(|member| member.name.as_str()).collect();
    let mut arrays = Vec::new();
    let mut fields = Vec::new();
    let mut told = None;
    let mut lengths: Vec<(&str, u64)> = Vec::new();
    for (place, wanted) in NAMES.iter().enumerate() {
        let found = members.iter().find_map(|member| {
            let (stem, unit) = unit_of_name(&member.name.to_ascii_lowercase());
            wanted.contains(&stem.as_str()).then_some((member, unit))
        });
        let (member, unit) = found.ok_or_else(|| RecordingError::Unsupported {
            what: format!("the archive holds [{}] and no \"{}\"", names.join(", "), wanted[0]),
            advice: "save it with np.savez(file, t=t, x=x, y=y, p=p)".to_owned(),
        })?;
        if place == 0 {
            told = unit;
        }
        let mut input = input(path, member)?;
        let header = ArrayHeader::read(&mut input)?;
        let Elements::Plain(kind) = header.elements else {
            return Err(damaged(format!("the array \"{}\" has fields", member.name)));
        };
        lengths.push((&member.name, header.shape.iter().copied().fold(1, u64::saturating_mul)));
        fields.push(Field { array: arrays.len(), offset: 0, kind });
        arrays.push(Array { input, stride: kind.bytes });
    }
    let left = lengths.first().map_or(0, |&(_, length)| length);
    if lengths.iter().any(|&(_, length)| length != left) {
        let told: Vec<String> =
            lengths.iter().map(|(name, length)| format!("\"{name}\" {length}")).collect();
        return Err(RecordingError::Unsupported {
            what: format!("the arrays are of different lengths: {}", told.join(", ")),
            advice: "save arrays with one entry each for every event".to_owned(),
        });
    }
    let fields: [Field; 4] = fields.try_into().map_err(|_| damaged("no four arrays".to_owned()))?;
    let mut source = Arrays { arrays, fields, unit: TimeUnit::Microseconds, left, record: 0 };
    let assumed = vec![source.find_unit(time_unit, told)?];
    Ok(Opened {
        format: "NPZ",
        geometry: None,
        assumed,
        about: Vec::new(),
        source: Box::new(source),
    })
}

fn members(path: &Path) -> Result<Vec<Member>, RecordingError> {
    let mut archive =
        zip::ZipArchive::new(file(path)?).map_err(|error| damaged(error.to_string()))?;
    (0..archive.len())
        .map(|index| {
            let member = archive.by_index_raw(index).map_err(|error| damaged(error.to_string()))?;
            let deflated = match member.compression() {
                CompressionMethod::Stored => false,
                CompressionMethod::Deflated => true,
                other => return Err(damaged(format!("an array compressed by {other}"))),
            };
            let name = member.name().map_err(|error| damaged(error.to_string()))?;
            Ok(Member {
                name: name.trim_end_matches(".npy").to_owned(),
                start: member
                    .data_start()
                    .ok_or_else(|| damaged("an archive without places".to_owned()))?,
                size: member.compressed_size(),
                deflated,
            })
        })
        .collect()
}

fn file(path: &Path) -> Result<File, RecordingError> {
    File::open(path).map_err(RecordingError::Open)
}

fn input(path: &Path, member: &Member) -> Result<Input, RecordingError> {
    let mut file = file(path)?;
    file.seek(SeekFrom::Start(member.start))
        .map_err(|cause| RecordingError::Read { offset: member.start, cause })?;
    let packed = file.take(member.size);
    Ok(Input::new(if member.deflated {
        Box::new(DeflateDecoder::new(packed))
    } else {
        Box::new(packed)
    }))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    use std::io::Write;

    use zip::write::{SimpleFileOptions, ZipWriter};

    use super::*;
    use crate::recording::npy::MAGIC;

    /// An archive of byte arrays t, x, y, p of these lengths.
    fn archive(path: &Path, lengths: [usize; 4]) {
        let mut zip = ZipWriter::new(File::create(path).unwrap());
        for (name, length) in ["t", "x", "y", "p"].into_iter().zip(lengths) {
            let header =
                format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({length},)}}");
            let told = (header.len() as u16).to_le_bytes();
            let options =
                SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
            zip.start_file(format!("{name}.npy"), options).unwrap();
            let bytes = [MAGIC, &[1, 0], &told, header.as_bytes(), &vec![1; length]].concat();
            zip.write_all(&bytes).unwrap();
        }
        zip.finish().unwrap();
    }

    #[test]
    fn arrays_of_different_lengths_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.npz");
        archive(&path, [20; 4]);
        assert!(open(&path, None).is_ok());
        archive(&path, [20, 10, 20, 20]);
        let told = open(&path, None).err().unwrap().to_string();
        assert!(told.contains("different lengths: \"t\" 20, \"x\" 10, \"y\" 20"), "{told}");
    }
}
