// What ajv, strict and with all errors, has against documents.
//   node schema.mjs FOLDER SCHEMA.json DOCUMENTS.json
// FOLDER has node_modules/; DOCUMENTS is a list. A list of lists of { at, keyword, message } goes to standard output.
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [folder, schema, documents] = process.argv.slice(2);
const entry = path.resolve(folder, 'node_modules/ajv/dist/2020.js');
const { default: module } = await import(pathToFileURL(entry).href);
const Ajv = module.default ?? module;
const read = (file) => JSON.parse(fs.readFileSync(file, 'utf8'));
const validate = new Ajv({ strict: true, allErrors: true }).compile(read(schema));
const judge = (document) => {
  validate(document);
  // `if` adds one that says only that there are others.
  const errors = (validate.errors ?? []).filter(({ keyword }) => keyword !== 'if' && keyword !== 'propertyNames');
  return errors.map(({ instancePath, keyword, message }) => ({ at: instancePath, keyword, message }));
};
process.stdout.write(JSON.stringify(read(documents).map(judge)));
